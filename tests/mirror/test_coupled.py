"""Mirrors of several axes: response against a twin, the file that reads back to the bit, tilts from displacements."""

import tomllib
from dataclasses import fields, replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oracles
from microrad.core import lti
from microrad.mirror import coupled
from microrad.mirror.coupled import Actuator, CoupledMirror, Known, Output
from microrad.mirror.coupled.reading import _known
from microrad.mirror.coupled.spread import accepted, changed, directions, drawn, draws, is_one, moved
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii
from microrad.mirror.model import Mirror
from microrad.mission.file import MissionError, load_coupled_mirror
from microrad.mission.tables.coupled_mirror import CoupledMirror as Table

SAMPLES, RATE_HZ, STEPS = 64, 1000.0, 2


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def channels(actuators, outputs):
    """Names and ranges, each another, and outputs of both quantities."""
    return (
        tuple(Actuator(f"u {i}", 0.1 * i, -1.0 - i, 3.0 + i / 3, 1e3 / (i + 1)) for i in range(actuators)),
        tuple(Output(f"y {i}", ("displacement", "angle")[i % 2]) for i in range(outputs)),
    )


def made(seed, modes=3, actuators=2, outputs=2, bouc_wen=1, plays=2, fed=True):
    """A mirror of any numbers, slow enough that it does not run away."""
    draw, elements = philox(seed).standard_normal, bouc_wen + plays
    roots = [(-20.0 * (1 + abs(float(draw()))), (i % 3 != 1) * 300.0 * float(draw())) for i in range(modes)]
    A = lti.modal_matrix(roots)
    states = A.shape[0]
    mirror = Mirror(
        name="made of draws",
        A=A,
        B=100 * draw((states, actuators)),
        E=draw((states, elements)),
        F=fed * 0.1 * draw((elements, states)),
        G=draw((elements, actuators)),
        C=draw((outputs, states)),
        D=0.1 * draw((outputs, actuators)),
        K=draw((outputs, elements)),
        bouc_wen=tuple(
            BoucWen(0.1 * float(draw()), 0.0, 0.3 * float(draw()), 0.0, 2.0, 0.5, gamma_1_v=0.1, eta_1_v=0.2)
            for _ in range(bouc_wen)
        ),
        plays=tuple(bent(draw, i) for i in range(plays)),
        inverse=(),
    )
    return CoupledMirror(mirror, *channels(actuators, outputs), 3.3e-4, RATE_HZ, STEPS, (1.0, 400.0))


def bent(draw, i):
    """Plays of any weights, every second operator with a polynomial."""
    weights, (c1, c2, c3) = tuple((0.1 * draw(3)).tolist()), (0.1 * draw(3)).tolist()
    plain = PrandtlIshlinskii((0.0, 0.1 + i, 0.7 + i), weights)
    return replace(plain, polynomial_rad=(c1, c2, c3), reach_v=0.5 + i) if i % 2 else plain


def read_back(mirror):
    return coupled.of(load_coupled_mirror("mirror.toml", text=coupled.text(mirror)))


def drive_of(seed, actuators):
    """A multisine of five lines: amplitude and phase of each, and its samples."""
    rng = philox(seed)
    lines = rng.standard_normal((5, actuators)) + 1j * rng.standard_normal((5, actuators))
    return lines, sampled(lines, np.arange(SAMPLES) / RATE_HZ)


def sampled(lines, time_s):
    """Sum of the lines 1 to 5 of a period of SAMPLES at the times."""
    turn = np.exp(2j * np.pi * np.outer(time_s, np.arange(1, 6)) * RATE_HZ / SAMPLES)
    return (turn @ lines).real


def twin_of(mirror):
    """The plant as the twins of the kernels take it."""
    rows = tuple(oracles.BoucWen(*(getattr(b, f.name) for f in fields(b))) for b in mirror.bouc_wen)
    operators = tuple(
        oracles.Operator(p.thresholds_v, p.weights_rad_v, polynomial=p.polynomial_rad, reach=p.reach_v)
        for p in mirror.plays
    )
    return oracles.Mirror(*(getattr(mirror, name) for name in "ABEFGCDK"), rows, operators)


# ------------------------------------------------------------------------------------------------------------ response
@pytest.mark.promise("mirror-file-27", "mirror-file-28", "mirror-file-33", "mirror-file-36", "mirror-file-37")
@pytest.mark.parametrize("fed", [True, False])
def test_the_response_is_that_of_the_twin_to_a_drive_of_the_delay_ago(fed):
    """The drive between samples from its lines, the plant by dense matrix exponentials."""
    mirror = made(1, fed=fed)
    lines, drive = drive_of(2, 2)
    at = np.arange(SAMPLES * STEPS) / (RATE_HZ * STEPS)
    expected = oracles.open_loop(twin_of(mirror.mirror), mirror.step_s, sampled(lines, at - mirror.delay_s))[0][::STEPS]
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(mirror.response(drive), expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    in_time = oracles.open_loop(twin_of(mirror.mirror), mirror.step_s, sampled(lines, at))[0][::STEPS]
    assert np.abs(in_time - expected).max() > 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("shape", [(SAMPLES,), (SAMPLES, 1), (SAMPLES, 3), (0, 2), (2, SAMPLES, 2)])
def test_a_drive_of_another_shape_is_refused(shape):
    with pytest.raises(ValueError, match=r"give samples x 2, a column for each actuator of 'made of draws'"):
        made(0).response(np.zeros(shape))


def test_a_step_too_long_for_the_stiffness_names_one_that_would_do():
    slow = replace(made(0), rate_hz=10.0, steps_per_sample=1, excited_hz=(0.1, 5.0))
    stiff = replace(slow, mirror=replace(slow.mirror, E=300 * slow.mirror.E))
    with pytest.raises(ValueError, match=r"is no contraction at a step of 0.1 s; use a step of at most"):
        stiff.response(np.zeros((SAMPLES, 2)))


@pytest.mark.promise("mirror-file-34")
def test_the_units_of_states_and_of_elements_are_free():
    """Each pair of states in another unit, and each play's output in another: the response is the same."""
    mirror = made(4, bouc_wen=0)
    m, drive = mirror.mirror, drive_of(2, 2)[1]
    states = np.concatenate(
        [np.full(2 if w else 1, size) for (_, w), size in zip(coupled.modes(m.A), (3.0, 0.2, 7.0), strict=True)]
    )
    of_z = np.array([0.5, 4.0])
    plays = tuple(
        replace(
            p,
            weights_rad_v=tuple(size * w for w in p.weights_rad_v),
            polynomial_rad=tuple(size * c for c in p.polynomial_rad),
        )
        for p, size in zip(m.plays, of_z, strict=True)
    )
    other = replace(
        m,
        B=states[:, None] * m.B,
        E=states[:, None] * m.E / of_z,
        F=m.F / states,
        C=m.C / states,
        K=m.K / of_z,
        plays=plays,
    )
    expected = mirror.response(drive)
    found = replace(mirror, mirror=other).response(drive)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    halved = replace(mirror, mirror=replace(m, B=0.5 * m.B)).response(drive)
    assert np.abs(halved - expected).max() > 0.01 * np.abs(expected).max()


@pytest.mark.promise("mirror-file-35", "mirror-file-44")
def test_a_mode_has_the_frequency_and_damping_that_its_two_numbers_are_written_for():
    f, d = 140.0, 0.1
    decay, frequency = 2 * np.pi * f * d, 2 * np.pi * f * np.sqrt(1 - d**2)
    A = lti.modal_matrix([(-decay, frequency), (-400.0, 0.0)])
    np.testing.assert_array_equal(A, [[-decay, -frequency, 0], [frequency, -decay, 0], [0, 0, -400.0]])
    pole = np.linalg.eigvals(A)[0]
    assert abs(pole) / (2 * np.pi) == pytest.approx(f) and -pole.real / abs(pole) == pytest.approx(d)
    turned = lti.modal_matrix([(-decay, -frequency)])
    np.testing.assert_array_equal(turned, A[:2, :2].T)  # below 0 the two states turn the other way


@pytest.mark.promise("mirror-file-37")
def test_another_step_is_another_response_where_hysteresis_is_fed_back():
    """The step that counts is that of `steps_per_sample`."""
    mirror, drive = made(4, bouc_wen=0), drive_of(2, 2)[1]
    assert mirror.step_s == 1.0 / (mirror.rate_hz * mirror.steps_per_sample)
    coarse, fine = (replace(mirror, steps_per_sample=n).response(drive) for n in (2, 8))
    assert 1e-4 < np.abs(coarse - fine).max() / np.abs(fine).max() < 0.1


@pytest.mark.promise("mirror-file-39")
@pytest.mark.parametrize("elements", [6, 7])
def test_each_combination_of_up_to_six_operators_is_looked_at(elements):
    """Two that hold each other where both slide: the one that slides alone runs away, and is seen among six."""
    A, E, F = -np.eye(2), np.zeros((2, elements)), np.zeros((elements, 2))
    E[0, :2], F[:2, 0] = (1.0, -1.0), 1.0
    gains = np.zeros(elements)
    gains[:2] = 3.0
    growth = lti.growth_1_s(A, E, F, gains)
    assert growth == pytest.approx(2.0 if elements == 6 else -1.0)


@pytest.mark.promise("hysteretic-stiffness-8")
def test_a_polynomial_may_soften_a_spring_until_it_rests_at_two_places():
    """k q = z(q) with z = 1.5 k q^2 to its reach of 1, held beyond it: rest at 0 and at 1.5, none at 2 / 3."""
    w, s = 600.0, -60.0
    k = (s**2 + w**2) / w
    play = PrandtlIshlinskii((0.0,), (0.0,), polynomial_rad=(1.5 * k, 0.0, 0.0), reach_v=1.0)
    one = Mirror(
        name="two rests",
        A=lti.modal_matrix([(s, w)]),
        B=np.array([[k], [0.0]]),
        E=np.array([[1.0], [0.0]]),
        F=np.array([[0.0, 1.0]]),
        G=np.zeros((1, 1)),
        C=np.array([[0.0, 1.0]]),
        D=np.zeros((1, 1)),
        K=np.zeros((1, 1)),
        bouc_wen=(),
        plays=(play,),
        inverse=(),
    )
    step_s, ends = 1e-4, []
    for push in (0.05, 2.0):
        drive = np.where(np.arange(4000) < 1000, push, 0.0)
        ends.append(one.response(drive, step_s)[-1])
    np.testing.assert_allclose(ends, [0.0, 1.5], atol=1e-6)


@pytest.mark.promise("mirror-file-35", "mirror-file-44")
def test_modes_are_found_in_the_order_of_their_states():
    roots = [(-1.0, 0.0), (-2.0, 30.0), (-3.0, -40.0), (-2.0, 0.0), (-2.0, 0.0)]
    assert coupled.modes(lti.modal_matrix(roots)) == tuple(roots)
    assert coupled.modes(np.zeros((0, 0))) == ()


def test_a_plant_in_another_form_or_of_other_channels_is_refused():
    mirror = made(0)
    for A in ([[-1.0, 2.0], [2.0, -1.0]], [[-1.0, 2.0], [-2.0, -3.0]], [[-1.0, 1.0], [0.0, -3.0]]):
        with pytest.raises(ValueError, match="bring the mirror into real modal form first"):
            coupled.modes(np.array(A))
    coupling = mirror.mirror.A.copy()
    coupling[0, -1] = 1.0
    with pytest.raises(ValueError, match="not block-diagonal"):
        replace(mirror, mirror=replace(mirror.mirror, A=coupling))
    with pytest.raises(ValueError, match="1 actuators are named, and the mirror has 2"):
        replace(mirror, actuators=mirror.actuators[:1])
    with pytest.raises(ValueError, match="3 outputs are named, and the mirror has 2"):
        replace(mirror, outputs=(*mirror.outputs, Output("more", "angle")))


# ---------------------------------------------------------------------------------------------------------- round trip
@pytest.mark.promise("mirror-file-27", "mirror-file-29")
@settings(deadline=None, max_examples=60)  # the machine may be busy
@given(
    seed=st.integers(0, 10**6),
    modes=st.integers(0, 4),
    actuators=st.integers(1, 3),
    outputs=st.integers(1, 3),
    bouc_wen=st.integers(0, 2),
    plays=st.integers(0, 2),
    fed=st.booleans(),
)
def test_a_file_reads_back_to_the_bit_and_so_does_its_response(seed, **sizes):
    mirror = made(seed, **sizes)
    if not sizes["bouc_wen"] + sizes["plays"] + sizes["modes"] and not mirror.mirror.D.any():
        return
    found = read_back(mirror)
    same(found, mirror)
    drive = drive_of(seed + 1, sizes["actuators"])[1]
    np.testing.assert_array_equal(found.response(drive), mirror.response(drive))


def same(found, mirror):
    """All numbers alike, to the last bit."""
    for each in fields(Mirror):
        one, other = (getattr(m.mirror, each.name) for m in (found, mirror))
        assert np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other, each.name
    for each in fields(CoupledMirror):
        if each.name not in ("mirror", "known"):
            assert getattr(found, each.name) == getattr(mirror, each.name), each.name
    assert (found.known is None) == (mirror.known is None)
    if found.known is not None:
        assert found.known.parameters == mirror.known.parameters
        np.testing.assert_array_equal(found.known.standard_errors, mirror.known.standard_errors)
        np.testing.assert_array_equal(found.known.factor, mirror.known.factor)


NUMBER = st.floats(-1e100, 1e100)
QUANTITY = st.just(0.0) | st.floats(1e-29, 1e29) | st.floats(-1e29, -1e-29)


@settings(deadline=None, max_examples=60)  # the machine may be busy
@given(gains=st.lists(NUMBER, min_size=4, max_size=4), decay=st.floats(1e-29, 1e29), w=QUANTITY, delay=QUANTITY)
def test_any_number_reads_back(gains, decay, w, delay):
    """Without hysteresis nothing can run away: the largest numbers and the smallest that a file may hold."""
    plain = made(0, modes=1, bouc_wen=0, plays=0)
    A = lti.modal_matrix([(-decay, w)])
    C = np.array([gains[:2], gains[2:]])[:, : A.shape[0]]
    plain = replace(
        plain,
        mirror=replace(
            plain.mirror,
            A=A,
            B=np.ones((A.shape[0], 2)),
            E=np.zeros((A.shape[0], 0)),
            F=np.zeros((0, A.shape[0])),
            C=C + (C == 0),
        ),
        delay_s=delay,
    )
    same(read_back(plain), plain)


def whole():
    """A mirror that uses all that a file may hold."""
    mirror = made(5, fed=False)
    rated = BoucWen(0.1, -3e-7, -0.02, 5e-4, 2.4, 0.6, 1e4, 5.0, 0.1, 0.2, 1.5)
    plays = (
        PrandtlIshlinskii((0.2, 0.4), (0.3, -0.1), 2e-5, 2e4),
        replace(mirror.mirror.plays[1], polynomial_rad=(0.1, -0.2, 1 / 3), reach_v=0.7),
    )
    factor = philox(8).standard_normal((5, 3))
    factor /= np.linalg.norm(factor, axis=1, keepdims=True)
    names = (
        "recording.delay",
        "modes.frequency.1",
        "matrices.B.2.1",
        "hysteresis.3.polynomial.2",
        "hysteresis.1.exponent",
    )
    at = ((0.03, 0.0), (-0.015, 0.026), (-0.015, -0.026))
    outputs = tuple(Output(f'sensor "{i}" \\ µ', "displacement", place) for i, place in enumerate(at))
    D = philox(6).standard_normal((3, 2))
    plant = replace(
        mirror.mirror,
        bouc_wen=(rated,),
        plays=plays,
        D=D,
        C=np.vstack([mirror.mirror.C, mirror.mirror.C[:1]]),
        K=np.vstack([mirror.mirror.K, 2 * mirror.mirror.K[:1]]),
    )
    return replace(
        mirror, mirror=plant, outputs=outputs, known=Known(names, np.array([1e-6, 0.1, 0.0, 3e-3, 0.25]), factor)
    )


@pytest.mark.promise("mirror-file-29", "mirror-file-49", "mirror-file-51")
def test_all_that_a_file_holds_reads_back():
    mirror = whole()
    found = read_back(mirror)
    same(found, mirror)
    drive = drive_of(3, 2)[1]
    np.testing.assert_array_equal(found.response(drive), mirror.response(drive))
    assert np.abs(found.response(drive)).max() > 0.1
    np.testing.assert_allclose(np.diag(found.known.correlation), 1.0, atol=1e-15)


@pytest.mark.promise("mirror-file-52")
def test_a_covariance_may_be_larger_than_a_mission_file():
    """Of 240 parameters: more than the megabyte that other files have."""
    mirror = made(5, modes=20, actuators=3, outputs=3, bouc_wen=0, plays=0)
    states = mirror.mirror.A.shape[0]
    pairs = list(product(range(1, states + 1), range(1, 4)))
    names = (*(f"matrices.B.{i}.{j}" for i, j in pairs), *(f"matrices.C.{j}.{i}" for i, j in pairs))[:240]
    factor = philox(3).standard_normal((len(names), 230))
    factor /= np.linalg.norm(factor, axis=1, keepdims=True)
    large = replace(mirror, known=Known(names, np.arange(float(len(names))), factor))
    assert len(coupled.text(large)) > 1_000_000
    same(read_back(large), large)


def test_the_text_is_to_be_read_by_people():
    """A row of a matrix a line, Hz and damping behind each mode, comments at the head that cannot end the comment."""
    mirror = whole()
    text = coupled.text(mirror, ["Mirror identified from records\nversion = 3", "second"])
    lines = text.split("\n")
    assert lines[:2] == ["# Mirror identified from records version = 3", "# second"]
    assert lines.index("version = 2") == 3
    begin = lines.index("B = [")
    states = mirror.mirror.A.shape[0]
    assert lines[begin + states + 1] == "]"
    assert [float(v) for v in lines[begin + 2].strip(" [],").split(",")] == mirror.mirror.B[1].tolist()
    s, w = coupled.modes(mirror.mirror.A)[0]
    size = abs(complex(s, w))
    first = next(line for line in lines if "# mode 1:" in line)
    assert first.split("# mode 1: ")[1] == f"{size / (2 * np.pi):.6g} Hz, damping {-s / size:.4g}"
    assert next(line for line in lines if "# mode 2:" in line).endswith("Hz, real")
    assert max(len(line) for line in lines) < 130


@pytest.mark.promise("mirror-file-33")
@pytest.mark.promise("hysteresis-1")
def test_elements_of_both_models_may_stand_in_any_order():
    """A file may count plays first; the plant has Bouc-Wen elements first."""
    mirror = made(5)
    data = tomllib.loads(coupled.text(mirror))
    data["hysteresis"] = {"1": data["hysteresis"]["3"], "2": data["hysteresis"]["1"], "3": data["hysteresis"]["2"]}
    turned = [2, 0, 1]
    for name in "EK":
        data["matrices"][name] = [[row[i] for i in turned] for row in data["matrices"][name]]
    for name in "FG":
        data["matrices"][name] = [data["matrices"][name][i] for i in turned]
    found = coupled.of(Table.model_validate(data))
    order = [0, 2, 1]  # the plays have changed places
    np.testing.assert_array_equal(found.mirror.E, mirror.mirror.E[:, order])
    np.testing.assert_array_equal(found.mirror.G, mirror.mirror.G[order])
    assert found.mirror.bouc_wen == mirror.mirror.bouc_wen
    assert found.mirror.plays == mirror.mirror.plays[::-1]
    drive = drive_of(3, 2)[1]
    np.testing.assert_allclose(found.response(drive), mirror.response(drive), rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("change", "key", "reason"),
    [
        ({"delay_s": float("nan")}, "mirror.recording.delay", ""),
        (
            {"known": Known(("modes.decay.9",), np.ones(1), np.ones((1, 1)))},
            "mirror.uncertainty.parameters",
            "is no parameter of this mirror",
        ),
        (
            {"known": Known(("modes.decay.1",), np.ones(1), 2 * np.ones((1, 1)))},
            "mirror.uncertainty.factor",
            "the length 2",
        ),
    ],
)
def test_nothing_is_written_that_would_not_be_read(change, key, reason):
    with pytest.raises(MissionError) as refused:
        coupled.text(replace(made(0), **change))
    assert [fault.key for fault in refused.value.faults] == [key]
    assert reason in refused.value.faults[0].reason


# ------------------------------------------------------------------------------------------------------------ geometry
def placed(*places):
    return tuple(Output(f"y {i}", "displacement", place) for i, place in enumerate(places))


@pytest.mark.promise("mirror-file-34", "mirror-file-38")
def test_tilts_and_piston_of_a_plane_that_is_turned():
    """A plane through three or four places: turned about x it rises at positive y, about y at negative x."""
    tilt_x, tilt_y, piston = 3e-4, -2e-4, 5e-6
    turned_about_x = np.array([[1, 0, 0], [0, np.cos(tilt_x), -np.sin(tilt_x)], [0, np.sin(tilt_x), np.cos(tilt_x)]])
    turned_about_y = np.array([[np.cos(tilt_y), 0, np.sin(tilt_y)], [0, 1, 0], [-np.sin(tilt_y), 0, np.cos(tilt_y)]])
    for places in (((0.03, 0.01), (-0.015, 0.026), (-0.02, -0.03)), ((0.03, 0), (0, 0.03), (-0.03, 0), (0, -0.03))):
        moved = [(turned_about_y @ turned_about_x @ [x, y, 0.0])[2] + piston for x, y in places]
        found = coupled.tilts_and_piston(placed(*places)) @ moved
        np.testing.assert_allclose(found, [tilt_x, tilt_y, piston], rtol=1e-3, atol=1e-9)


@pytest.mark.promise("mirror-file-38")
def test_more_places_than_three_average_their_noise():
    """Four sensors on a circle of radius r: a tilt has the variance of one over 2 r^2, the piston a quarter of it."""
    matrix = coupled.tilts_and_piston(placed((0.03, 0), (0, 0.03), (-0.03, 0), (0, -0.03)))
    covariance = matrix @ matrix.T
    np.testing.assert_allclose(covariance, np.diag([1 / (2 * 0.03**2), 1 / (2 * 0.03**2), 0.25]), rtol=1e-12, atol=1e-9)


def test_angles_have_no_part_in_the_geometry():
    outputs = placed((0.03, 0.01), (-0.015, 0.026), (-0.02, -0.03))
    matrix = coupled.tilts_and_piston((outputs[0], Output("angle", "angle"), *outputs[1:]))
    assert matrix.shape == (3, 4)
    assert not matrix[:, 1].any()
    np.testing.assert_array_equal(matrix[:, [0, 2, 3]], coupled.tilts_and_piston(outputs))


@pytest.mark.parametrize(
    ("places", "reason"),
    [
        (((0.0, 0.0), (0.01, 0.01), (0.03, 0.03)), "on one line"),
        (((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)), "on one line"),
        (((0.0, 0.0), (0.01, 0.0)), "2 of 2 displacements have a position; two tilts and a piston take at least three"),
        (((0.0, 0.0), (0.01, 0.0), (0.0, 0.01), None), "3 of 4 displacements have a position"),
        ((), "0 of 0 displacements"),
    ],
)
def test_places_that_do_not_span_the_tilts_are_refused(places, reason):
    with pytest.raises(ValueError, match=reason):
        coupled.tilts_and_piston(placed(*places))


def test_places_almost_on_a_line_still_span():
    assert np.isfinite(coupled.tilts_and_piston(placed((0.0, 0.0), (0.01, 1e-5), (0.02, 0.0)))).all()


def one_state(decay=-1.0, gain=0.0, play=None, thresholds=(0.0, 1.0)):
    """One real mode, and plays that it drives and that drive it."""
    plain = made(0, modes=1, actuators=1, outputs=1, bouc_wen=0, plays=1)
    plays = PrandtlIshlinskii(thresholds, (gain, -2.0 * gain)) if play is None else play
    parts = {"A": np.array([[decay]]), "B": np.ones((1, 1)), "E": np.ones((1, 1)), "F": np.ones((1, 1))}
    return replace(plain, mirror=replace(plain.mirror, **parts, C=np.ones((1, 1)), G=np.zeros((1, 1)), plays=(plays,)))


@pytest.mark.parametrize(
    ("mirror", "one"),
    [
        (one_state(), True),
        (one_state(decay=0.0), False),
        (one_state(gain=1.0), False),  # the first play, which never sticks, takes all of the decay
        (one_state(gain=0.99), True),
        (one_state(gain=-1.0), False),  # both together do, where they slide
        (one_state(gain=-0.99), True),
        (one_state(thresholds=(0.0, 0.0)), False),
        (made(0, modes=0), True),
        (made(0, modes=0, plays=0), True),
    ],
)
def test_a_mirror_that_grows_or_whose_thresholds_meet_is_none(mirror, one):
    assert is_one(mirror) is one


@pytest.mark.parametrize(
    ("model", "one"),
    [
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, 0.5), True),
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, 1.999), True),
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, 2.0), False),
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, -2.0), False),
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, 1.5, gamma_1_v=0.4), True),
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, 1.5, gamma_1_v=0.5), False),
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, 1.5, gamma_1_v=-0.5), False),
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, 1.5, gamma_1_v=0.5, eta_1_v=0.5), True),
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, 1.5, eta_1_v=0.5), False),
        (BoucWen(0.1, 0.0, 0.1, 0.0, 2.0, 0.5, exponent=0.999), False),
    ],
)
def test_a_mirror_whose_hysteresis_grows_without_bound_is_none(model, one):
    plain = made(0, modes=0, plays=0)
    assert is_one(replace(plain, mirror=replace(plain.mirror, bouc_wen=(model,)))) is one


def test_every_number_of_a_mirror_is_changed_where_its_key_says():
    mirror = whole()
    own = mirror.mirror
    by = {
        "matrices.B.2.1": 0.5,
        "matrices.B.1.2": -0.25,
        "matrices.K.3.2": 0.125,
        "hysteresis.2.thresholds.2": 0.25,
        "hysteresis.2.weights.2": -1.0,
        "hysteresis.3.polynomial.2": 0.5,
        "recording.delay": 1e-4,
    }
    found = changed(mirror, by)
    for name in "ABCDEFGK":
        expected = getattr(own, name).copy()
        if name == "B":
            expected[1, 0] += 0.5
            expected[0, 1] -= 0.25
        if name == "K":
            expected[2, 1] += 0.125
        np.testing.assert_array_equal(getattr(found.mirror, name), expected)
    _, second, third = found.mirror.bank
    assert second == replace(own.bank[1], thresholds_v=(0.2, 0.65), weights_rad_v=(0.3, -1.1))
    assert third == replace(own.bank[2], polynomial_rad=(0.1, 0.3, 1 / 3))
    assert found.mirror.bank[0] == own.bank[0]
    assert found.delay_s == pytest.approx(mirror.delay_s + 1e-4)
    same(changed(mirror, {}), mirror)


def test_what_is_at_least_0_stays_so_and_a_decay_keeps_a_tenth():
    mirror = whole()
    by = {
        "hysteresis.2.thresholds.1": -1.0,
        "hysteresis.2.weights.1": -1.0,
        "hysteresis.2.widening": -1.0,
        "hysteresis.1.epsilon": -1.0,
        "recording.delay": -1.0,
    }
    found = changed(mirror, by)
    plays = found.mirror.bank[1]
    assert (plays.thresholds_v, plays.weights_rad_v, plays.widening_s) == ((0.0, 0.4), (0.0, -0.1), 0.0)
    assert found.mirror.bank[0].epsilon_rad_v == -1.02
    assert found.delay_s == 0.0

    roots = [(-20.0, 30.0), (-10.0, -40.0), (-5.0, 0.0)]
    modal = replace(mirror, mirror=replace(mirror.mirror, A=lti.modal_matrix(roots)))
    for key, change, at, expected in (
        ("decay.1", 5.0, 0, (-25.0, 30.0)),
        ("decay.1", -17.0, 0, (-3.0, 30.0)),
        ("decay.1", -19.0, 0, (-2.0, 30.0)),
        ("decay.3", -50.0, 2, (-0.5, 0.0)),
        ("frequency.1", -12.0, 0, (-20.0, 18.0)),
        ("frequency.2", 5.0, 1, (-10.0, -35.0)),
        ("frequency.2", -5.0, 1, (-10.0, -45.0)),
        ("frequency.2", 50.0, 1, (-10.0, -1e-9)),
        ("frequency.1", -50.0, 0, (-20.0, 1e-9)),
    ):
        moved_roots = coupled.modes(changed(modal, {f"modes.{key}": change}).mirror.A)
        assert moved_roots[at] == pytest.approx(expected, rel=1e-12), key
        assert [each for i, each in enumerate(moved_roots) if i != at] == [r for i, r in enumerate(roots) if i != at]


def known_by_each():
    """The whole mirror, with an error of each number that it names."""
    mirror = whole()
    return replace(mirror, known=replace(mirror.known, standard_errors=np.array([1e-6, 0.1, 0.5, 3e-3, 0.05])))


def test_a_mirror_is_moved_by_its_errors_along_the_directions_that_it_is_known_in():
    mirror = known_by_each()
    assert directions(mirror) == 3
    normals = np.array([0.5, -1.0, 0.25])
    by = mirror.known.standard_errors * (mirror.known.factor @ normals)
    found = moved(mirror, normals)
    same(found, replace(changed(mirror, dict(zip(mirror.known.parameters, by.tolist(), strict=True))), known=None))
    assert found.mirror.B[1, 0] - mirror.mirror.B[1, 0] == pytest.approx(by[2])
    same(moved(mirror, np.zeros(3)), replace(mirror, known=None))


def test_draws_are_mirrors_and_the_first_ones_are_alike_for_a_larger_count():
    mirror = known_by_each()
    two, three = (draws(mirror, count, 4) for count in (2, 3))
    assert len(two) == 2 and len(three) == 3
    for one, other in zip(two, three, strict=False):
        same(one, other)
    assert not np.array_equal(three[0].mirror.B, three[1].mirror.B)
    for found, normals in drawn(mirror, 2, 4):
        same(found, moved(mirror, normals))
    np.testing.assert_array_equal(accepted(mirror, np.zeros((2, 3)), lambda i: iter(())), np.zeros((2, 3)))
    unknown = replace(mirror, known=None)
    assert draws(unknown, 3, 4) == ()
    for ask in (lambda: drawn(unknown, 1, 0), lambda: directions(unknown), lambda: moved(unknown, np.zeros(3))):
        with pytest.raises(ValueError, match=r'the mirror "made of draws" has no table uncertainty'):
            ask()


def test_a_draw_that_is_no_mirror_is_drawn_again_and_without_end_refused(monkeypatch):
    """Of an exponent of 1 half of the draws lie below it."""
    plain = whole()
    first = replace(plain.mirror.bouc_wen[0], exponent=1.0)
    known = Known(("hysteresis.1.exponent",), np.array([0.1]), np.ones((1, 1)))
    mirror = replace(plain, mirror=replace(plain.mirror, bouc_wen=(first,)), known=known)
    asked = []

    def again(row):
        asked.append(row)
        return iter(np.array([[-0.5], [0.25], [0.75]]))

    found = accepted(mirror, np.array([[1.0], [-1.0], [0.0]]), again)
    np.testing.assert_array_equal(found, [[1.0], [0.25], [0.0]])
    monkeypatch.setattr("microrad.mirror.coupled.spread.TRIES", 2)
    with pytest.raises(ValueError, match=r"^2 draws from the uncertainty of 'made of draws' in a row run away, have"):
        accepted(mirror, np.array([[-1.0]]), again)


def test_every_change_of_an_element_is_made():
    mirror = whole()
    own = mirror.mirror.bank[0]
    by = {"hysteresis.1.d1": 1e-7, "hysteresis.1.alpha": 0.5, "hysteresis.1.beta": -0.25}
    found = changed(mirror, by)
    first = found.mirror.bank[0]
    assert first.d1_rad_v == own.d1_rad_v + 1e-7
    assert first.alpha_1_v == own.alpha_1_v + 0.5
    assert first.beta_1_v == own.beta_1_v - 0.25
    assert found.mirror.bank[1:] == mirror.mirror.bank[1:]


def handmade():
    """Two drives, three elements and numbers all unlike, round enough to be written by hand."""
    A = lti.modal_matrix([(-20.0, 300.0), (-7.0, 0.0)])
    mirror = Mirror(
        name="by hand",
        A=A,
        B=np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.5]]),
        E=np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]]),
        F=np.zeros((3, 3)),
        G=np.array([[1.1, 1.2], [1.3, 1.4], [1.5, 1.6]]),
        C=np.array([[7.0, 8.0, 9.0]]),
        D=np.array([[0.01, 0.02]]),
        K=np.array([[2.1, 2.2, 2.3]]),
        bouc_wen=(BoucWen(0.5, -1e-3, -0.25, 2e-3, 1.5, 0.75, 400.0, 3.0, 0.125, -0.375, 2.5),),
        plays=(
            PrandtlIshlinskii((0.0, 1.5), (0.6, -0.2), 5e-4, 700.0),
            PrandtlIshlinskii((0.5, 2.0, 4.0), (0.3, 0.1, 0.05), polynomial_rad=(0.7, -0.8, 0.9), reach_v=6.0),
        ),
        inverse=(),
    )
    actuators = (Actuator("left", 10.0, -2.0, 30.0, 4e3), Actuator("right", 11.0, -3.0, 31.0, 5e3))
    return CoupledMirror(mirror, actuators, (Output("gap", "displacement"),), 2e-4, 8e3, 3, (0.5, 900.0))


def test_a_mirror_of_numbers_all_unlike_is_written_line_by_line():
    factor = np.array([[0.6, 0.8], [-0.8, 0.6], [1.0, 0.0], [0.0, -1.0], [0.28, 0.96], [0.96, 0.28], [-0.6, 0.8]])
    names = (
        *("recording.delay", "modes.decay.2", "modes.frequency.1", "matrices.K.1.3"),
        *("hysteresis.1.epsilon", "hysteresis.2.weights.2", "hysteresis.3.polynomial.3"),
    )
    known = Known(names, np.array([1e-5, 0.5, 2.0, 0.25, 0.125, 0.0625, 0.03]), factor)
    written = coupled.text(replace(handmade(), known=known), ["made\tby", "hand"])
    assert written == (
        "# made by\n# hand\n"
        "# Matrices, weights and standard errors are plain numbers in SI units, drives and hysteresis in V.\n"
        'version = 2\nname = "by hand"\n\n'
        '[actuators.1]\nname = "left"\nbias = "10.0 V"\ndrive_min = "-2.0 V"\ndrive_max = "30.0 V"\n'
        'rate_limit = "4000.0 V/s"\n\n'
        '[actuators.2]\nname = "right"\nbias = "11.0 V"\ndrive_min = "-3.0 V"\ndrive_max = "31.0 V"\n'
        'rate_limit = "5000.0 V/s"\n\n'
        '[outputs.1]\nname = "gap"\nquantity = "displacement"\n\n'
        '[recording]\ndelay = "0.0002 s"\nrate = "8000.0 Hz"\nsteps_per_sample = 3\nexcited_from = "0.5 Hz"\n'
        'excited_to = "900.0 Hz"\n\n'
        '[modes]\ndecay = [\n  "20.0 1/s",\n  "7.0 1/s",\n]\nfrequency = [\n'
        '  "300.0 rad/s",                     # mode 1: 47.8525 Hz, damping 0.06652\n'
        '  "0.0 rad/s",                       # mode 2: 1.11408 Hz, real\n]\n\n'
        "[matrices]\nB = [\n  [1.0, 2.0],\n  [3.0, 4.0],\n  [5.0, 6.5],\n]\nC = [\n  [7.0, 8.0, 9.0],\n]\n"
        "D = [\n  [0.01, 0.02],\n]\n"
        "E = [\n  [0.1, 0.2, 0.3],\n  [0.4, 0.5, 0.6],\n  [0.7, 0.8, 0.9],\n]\n"
        "G = [\n  [1.1, 1.2],\n  [1.3, 1.4],\n  [1.5, 1.6],\n]\nK = [\n  [2.1, 2.2, 2.3],\n]\n\n"
        '[hysteresis.1]\nmodel = "bouc-wen"\nd1 = 0.5\nepsilon = -0.25\nalpha = "1.5 1/V"\nbeta = "0.75 1/V"\n'
        'd2 = "-0.001 s/V"\ndelta = "0.002 s/V"\ngamma = "0.125 1/V"\neta = "-0.375 1/V"\nbias = "3.0 V"\n'
        'exponent = 2.5\nrate_limit = "400.0 V/s"\n\n'
        '[hysteresis.2]\nmodel = "plays"\nthresholds = ["0.0 V", "1.5 V"]\nweights = [0.6, -0.2]\n'
        'widening = "0.0005 s"\nrate_limit = "700.0 V/s"\n\n'
        '[hysteresis.3]\nmodel = "plays"\nthresholds = ["0.5 V", "2.0 V", "4.0 V"]\nweights = [0.3, 0.1, 0.05]\n'
        'polynomial = [0.7, -0.8, 0.9]\nreach = "6.0 V"\n\n'
        "[uncertainty]\nparameters = [\n"
        '  "recording.delay", "modes.decay.2", "modes.frequency.1", "matrices.K.1.3", "hysteresis.1.epsilon", '
        '"hysteresis.2.weights.2",\n  "hysteresis.3.polynomial.3",\n]\n'
        "standard_errors = [\n  1e-05, 0.5, 2.0, 0.25, 0.125, 0.0625,\n  0.03,\n]\n"
        "factor = [\n  [0.6, 0.8],\n  [-0.8, 0.6],\n  [1.0, 0.0],\n  [0.0, -1.0],\n  [0.28, 0.96],\n"
        "  [0.96, 0.28],\n  [-0.6, 0.8],\n]\n"
    )


def test_what_is_known_of_elements_in_another_order_is_known_of_the_same_elements():
    """The file has plays, Bouc-Wen, plays: its columns of E and K, its rows of F and G and its elements are moved."""
    names = (
        *("hysteresis.1.weights.2", "hysteresis.2.alpha", "hysteresis.3.weights.1", "matrices.E.3.1"),
        *("matrices.K.1.2", "matrices.G.2.1", "matrices.B.2.1", "matrices.C.1.2", "modes.decay.2"),
    )
    factor = np.eye(9)
    data = tomllib.loads(coupled.text(handmade()))
    one, two, three = (data["hysteresis"][key] for key in "123")
    data["hysteresis"] = {"1": two, "2": one, "3": three}
    errors = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09]
    data["uncertainty"] = {"parameters": list(names), "standard_errors": errors, "factor": factor.tolist()}
    found = coupled.of(Table.model_validate(data))
    np.testing.assert_array_equal(found.mirror.E, handmade().mirror.E[:, [1, 0, 2]])
    np.testing.assert_array_equal(found.mirror.G, handmade().mirror.G[[1, 0, 2]])
    assert found.known.parameters == (
        *("hysteresis.2.weights.2", "hysteresis.1.alpha", "hysteresis.3.weights.1", "matrices.E.3.2"),
        *("matrices.K.1.1", "matrices.G.1.1", "matrices.B.2.1", "matrices.C.1.2", "modes.decay.2"),
    )
    assert found.known.standard_errors.tolist() == errors


def test_a_correlation_in_place_of_its_factor_has_rows_of_length_one():
    data = tomllib.loads(coupled.text(handmade()))
    names = ["hysteresis.2.weights.1", "matrices.D.1.2", "modes.frequency.1"]
    data["uncertainty"] = {
        "parameters": names,
        "standard_errors": [0.1, 0.002, 3.0],
        "correlation": [0.5, -0.25, 0.125],
    }
    known = coupled.of(Table.model_validate(data)).known
    assert known.parameters == tuple(names)
    expected = [[1.0, 0.5, -0.25], [0.5, 1.0, 0.125], [-0.25, 0.125, 1.0]]
    np.testing.assert_allclose(known.correlation, expected, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(known.factor, axis=1), 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("key", "field", "value"),
    [
        ("d1", "d1_rad_v", 0.5625),
        ("d2", "d2_s_v", 0.0615),
        ("epsilon", "epsilon_rad_v", -0.1875),
        ("delta", "delta_s_v", 0.0645),
        ("alpha", "alpha_1_v", 1.5625),
        ("beta", "beta_1_v", 0.8125),
        ("gamma", "gamma_1_v", 0.1875),
        ("eta", "eta_1_v", -0.3125),
        ("exponent", "exponent", 2.5625),
    ],
)
def test_each_number_of_an_element_is_changed_and_no_other(key, field, value):
    found = changed(handmade(), {f"hysteresis.1.{key}": 0.0625})
    assert getattr(found.mirror.bouc_wen[0], field) == pytest.approx(value, rel=1e-12)
    assert (
        replace(found.mirror.bouc_wen[0], **{field: getattr(handmade().mirror.bouc_wen[0], field)})
        == (handmade().mirror.bouc_wen[0])
    )
    assert found.mirror.plays == handmade().mirror.plays


def test_changes_of_one_part_add_up_and_leave_the_others():
    """Two entries of one matrix, two numbers of one element, one of another, and both numbers of a mode."""
    by = {
        "matrices.C.1.1": 0.5,
        "matrices.C.1.3": -0.25,
        "matrices.G.3.2": 2.0,
        "hysteresis.3.thresholds.1": 0.125,
        "hysteresis.3.weights.3": -1.0,
        "hysteresis.3.polynomial.1": -2.0,
        "hysteresis.2.weights.2": -0.5,
        "hysteresis.2.widening": 1e-4,
        "modes.decay.1": 3.0,
        "modes.frequency.1": 5.0,
        "recording.delay": -5e-5,
    }
    found = changed(handmade(), by)
    own = handmade().mirror
    assert coupled.modes(found.mirror.A) == ((-23.0, 305.0), (-7.0, 0.0))
    np.testing.assert_array_equal(found.mirror.C, [[7.5, 8.0, 8.75]])
    np.testing.assert_array_equal(found.mirror.G, [[1.1, 1.2], [1.3, 1.4], [1.5, 3.6]])
    assert found.mirror.bouc_wen == own.bouc_wen
    assert found.mirror.plays[0] == replace(own.plays[0], weights_rad_v=(0.6, -0.7), widening_s=5e-4 + 1e-4)
    third = found.mirror.plays[1]
    assert third == replace(
        own.plays[1],
        thresholds_v=(0.625, 2.0, 4.0),
        weights_rad_v=(0.3, 0.1, 0.0),
        polynomial_rad=(0.7 - 2.0, -0.8, 0.9),
    )
    assert found.delay_s == pytest.approx(1.5e-4, rel=1e-12)


def test_what_does_not_fit_a_mirror_is_said_in_all_words():
    mirror = handmade()
    said = []
    for ask in (
        lambda: replace(mirror, actuators=mirror.actuators[:1]),
        lambda: replace(mirror, outputs=()),
        lambda: mirror.response(np.zeros((5, 3))),
        lambda: moved(mirror, np.zeros(2)),
    ):
        with pytest.raises(ValueError) as refused:
            ask()
        said.append(str(refused.value))
    assert said == [
        "1 actuators are named, and the mirror has 2; name each, in their order",
        "0 outputs are named, and the mirror has 1; name each, in their order",
        "the drive has the shape (5, 3); give samples x 2, a column for each actuator of 'by hand'",
        'the mirror "by hand" has no table uncertainty, so nothing can be drawn; `microrad identify` writes one into '
        "its mirror file",
    ]
    assert mirror.step_s == pytest.approx(1 / 24e3, rel=1e-12)


@pytest.mark.parametrize(
    ("outputs", "words"),
    [
        (
            [("displacement", (0.0, 1.0)), ("displacement", None), ("displacement", (1.0, 0.0)), ("angle", None)],
            "2 of 3 displacements have a position; two tilts and a piston take at least three, and the position of "
            "each",
        ),
        (
            [("displacement", (0.0, 0.0)), ("angle", None), ("displacement", (1.0, 2.0)), ("displacement", (-2, -4))],
            "all displacements lie on one line, and a tilt about that line moves none; add one beside it",
        ),
    ],
)
def test_positions_without_a_plane_are_refused_in_all_words(outputs, words):
    with pytest.raises(ValueError) as refused:
        coupled.tilts_and_piston([Output(f"y {i}", *each) for i, each in enumerate(outputs)])
    assert str(refused.value) == words


def test_an_angle_between_displacements_keeps_its_column_of_zeros():
    places = ((0.0, 2.0), None, (3.0, -1.0), (-1.0, -2.0))
    outputs = [Output(f"y {i}", "displacement" if p else "angle", p) for i, p in enumerate(places)]
    matrix = coupled.tilts_and_piston(outputs)
    plane = [0.3, -0.7, 5.0]  # tilts about x and y, piston
    seen = [plane[2] + y * plane[0] - x * plane[1] for x, y in (place or (9.0, 9.0) for place in places)]
    np.testing.assert_allclose(matrix @ seen, plane, rtol=1e-12)
    assert not matrix[:, 1].any()


def test_a_row_that_is_no_mirror_is_drawn_again_by_its_own_number():
    """Of two exponents, each row asks for others by its number, and the first of them that is a mirror counts."""
    first = replace(handmade().mirror.bouc_wen[0], exponent=1.5)
    known = Known(("hysteresis.1.exponent", "recording.delay"), np.array([0.5, 1e-5]), np.eye(2))
    mirror = replace(handmade(), mirror=replace(handmade().mirror, bouc_wen=(first,)), known=known)
    others = {1: [[-3.0, 0.0], [1.0, 0.5]], 3: [[0.25, -0.5], [2.0, 2.0]]}
    rows = np.array([[0.5, 1.0], [-2.0, 0.0], [-0.75, 3.0], [-1.5, 9.0]])
    found = accepted(mirror, rows, lambda row: iter(np.array(others.get(row, []))))
    np.testing.assert_array_equal(found, [[0.5, 1.0], [1.0, 0.5], [-0.75, 3.0], [0.25, -0.5]])
    assert directions(mirror) == 2 and known.correlation.tolist() == np.eye(2).tolist()
    third = moved(mirror, found[2])
    assert third.mirror.bouc_wen[0].exponent == pytest.approx(1.125)
    assert (third.delay_s, third.known) == (pytest.approx(2.3e-4), None)


@pytest.mark.parametrize(
    ("changes", "one"),
    [
        ({}, True),
        ({"hysteresis.3.thresholds.2": -1.5}, False),  # both at 0.5 V
        ({"hysteresis.3.thresholds.2": -1.4}, True),
        ({"hysteresis.2.thresholds.2": -1.5}, False),
        ({"hysteresis.1.exponent": -1.5}, True),
        ({"hysteresis.1.exponent": -1.6}, False),
        ({"hysteresis.1.alpha": -0.5}, False),
        ({"modes.decay.1": -19.0}, True),
    ],
)
def test_each_reason_by_itself_makes_a_changed_mirror_none(changes, one):
    assert is_one(changed(handmade(), changes)) is one


def test_the_response_of_a_mirror_by_hand_is_that_of_its_twin():
    """Two drives, one output, elements with rate and polynomial left out; no state, and elements straight through."""
    mirror = handmade()
    drives = np.random.Generator(np.random.Philox(4)).standard_normal((40, 2))
    still = replace(
        mirror.mirror,
        **{"A": np.zeros((0, 0)), "B": np.zeros((0, 2)), "E": np.zeros((0, 2)), "F": np.zeros((2, 0))},
        **{"C": np.zeros((1, 0)), "G": mirror.mirror.G[1:], "K": mirror.mirror.K[:, 1:], "bouc_wen": ()},
        plays=(replace(mirror.mirror.plays[0], widening_s=0.0), mirror.mirror.plays[1]),
    )
    found = replace(mirror, mirror=still, delay_s=0.0, steps_per_sample=1).response(drives)
    expected = []
    states = [np.zeros(2), np.zeros(3)]
    for u in drives:
        total = float(still.D[0] @ u)
        for k, play in enumerate(still.plays):
            q, r = float(still.G[k] @ u), np.array(play.thresholds_v)
            states[k] = np.maximum(q - r, np.minimum(q + r, states[k]))
            z = float(states[k] @ play.weights_rad_v)
            if k == 1:
                s = min(max(q / 6.0, -1.0), 1.0)
                z += 0.7 * s**2 - 0.8 * abs(s) * s + 0.9 * s**3
            total += still.K[0, k] * z
        expected.append(total)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    "A",
    [
        [[-5.0, 3.0, 0.0], [-3.0, -5.0, 0.0], [0.0, 0.0, -2.0]],
        [[-2.0, 0.0, 0.0], [0.0, -5.0, -4.0], [0.0, 4.0, -5.0]],
    ],
)
def test_a_real_mode_may_stand_before_or_behind_a_pair(A):
    roots = coupled.modes(np.array(A))
    assert sorted(roots) == ([(-5.0, -3.0), (-2.0, 0.0)] if A[0][0] == -5.0 else [(-5.0, 4.0), (-2.0, 0.0)])
    np.testing.assert_array_equal(lti.modal_matrix(roots), A)


@pytest.mark.parametrize(
    ("A", "found"),
    [
        ([[1.0, -2.0], [2.0, 1.0]], ((1.0, 2.0),)),
        ([[1.0, 2.0], [-2.0, 1.0]], ((1.0, -2.0),)),
        ([[1.0, 0.0], [0.0, 2.0]], ((1.0, 0.0), (2.0, 0.0))),
        ([[-3.0]], ((-3.0, 0.0),)),
        (np.zeros((0, 0)), ()),
        ([[1.0, -2.0], [3.0, 1.0]], None),
        ([[1.0, -2.0], [2.0, 1.5]], None),
        ([[1.0, 0.1], [0.0, 2.0]], None),
        ([[1.0, 0.0, 0.5], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]], None),
    ],
)
def test_modes_are_read_from_blocks_of_either_sign_and_from_nothing_else(A, found):
    if found is None:
        with pytest.raises(ValueError) as refused:
            coupled.modes(np.array(A))
        assert str(refused.value) == (
            "A is not block-diagonal with a block [[s, -w], [w, s]] for each pair of poles and s for each real one; "
            "bring the mirror into real modal form first"
        )
    else:
        assert coupled.modes(np.array(A)) == found


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ('a "b" \\ c', r'name = "a \"b\" \\ c"'),
        ("x\ny\tz", r'name = "x\ny\tz"'),
        ("µ–ü 鏡", 'name = "µ–ü 鏡"'),
        ("del \x7f end", r'name = "del \u007f end"'),
    ],
)
def test_any_name_is_written_so_that_it_reads_back(name, written):
    mirror = handmade()
    named = replace(
        mirror,
        mirror=replace(mirror.mirror, name=name),
        outputs=(Output(name, "angle"),),
        actuators=(replace(mirror.actuators[0], name=f"{name} 1"), mirror.actuators[1]),
    )
    text = coupled.text(named, [f"of {name}"])
    assert text.count(f"\n{written}\n") == 2 and "position" not in text
    assert text.startswith("# of " + "".join(c if c.isprintable() else " " for c in name) + "\n# Matrices")
    found = read_back(named)
    assert (found.mirror.name, found.outputs, found.actuators) == (name, named.outputs, named.actuators)


@pytest.mark.parametrize(
    ("number", "changes", "lines"),
    [
        (0, {"exponent": 1.0, "bias_v": 0.0}, 'eta = "-0.375 1/V"\nrate_limit = "400.0 V/s"\n\n'),
        (
            0,
            {"gamma_1_v": 0.0, "eta_1_v": 0.0, "delta_s_v": 0.0},
            'd2 = "-0.001 s/V"\nbias = "3.0 V"\nexponent = 2.5\n',
        ),
        (0, {"d2_s_v": 0.0, "d1_rad_v": 0.0}, 'd1 = 0.0\nepsilon = -0.25\nalpha = "1.5 1/V"\nbeta = "0.75 1/V"\ndelta'),
        (0, {"epsilon_rad_v": 0.0, "beta_1_v": 0.0}, 'epsilon = 0.0\nalpha = "1.5 1/V"\nbeta = "0.0 1/V"\nd2'),
        (1, {"widening_s": 0.0}, 'weights = [0.6, -0.2]\nrate_limit = "700.0 V/s"\n\n'),
        (1, {"widening_s": 0.0, "rate_limit_v_s": np.inf}, "weights = [0.6, -0.2]\n\n[hysteresis.3]"),
        (1, {"reach_v": 2.0}, 'rate_limit = "700.0 V/s"\npolynomial = [0.0, 0.0, 0.0]\nreach = "2.0 V"\n'),
        (2, {"thresholds_v": (0.0,), "weights_rad_v": (0.5,)}, 'thresholds = ["0.0 V"]\nweights = [0.5]\npolynomial'),
        (2, {"reach_v": np.inf, "polynomial_rad": (0.0, 0.0, 0.0)}, "weights = [0.3, 0.1, 0.05]\n"),
    ],
)
def test_an_element_is_written_without_what_it_has_not_and_reads_back(number, changes, lines):
    mirror = handmade()
    bank = [replace(each, **changes) if i == number else each for i, each in enumerate(mirror.mirror.bank)]
    with_it = replace(mirror, mirror=replace(mirror.mirror, bouc_wen=tuple(bank[:1]), plays=tuple(bank[1:])))
    text = coupled.text(with_it)
    assert lines in text + "\n" and text.endswith("\n") and not text.endswith("\n\n")
    assert read_back(with_it).mirror.bank == tuple(bank)


@pytest.mark.parametrize(
    ("key", "change", "expected"),
    [
        ("recording.delay", 1e-4, 3e-4),
        ("recording.delay", -3e-4, 0.0),
        ("modes.decay.1", 5.0, -25.0),
        ("modes.decay.1", -19.0, -2.0),
        ("modes.decay.2", 3.0, -10.0),
        ("modes.frequency.1", -30.0, 270.0),
        ("modes.frequency.1", -400.0, 1e-9),
        ("matrices.B.3.2", 0.5, 7.0),
        ("matrices.E.1.3", 0.5, 0.8),
        ("matrices.F.2.3", 0.5, 0.5),
        ("matrices.G.3.1", -0.5, 1.0),
        ("matrices.C.1.2", 0.5, 8.5),
        ("matrices.D.1.2", 0.5, 0.52),
        ("matrices.K.1.3", 0.5, 2.8),
    ],
)
def test_one_number_of_a_mirror_is_changed_and_all_others_stay(key, change, expected):
    mirror = handmade()
    found, (what, *rest) = changed(mirror, {key: change}), key.split(".")
    roots = [list(root) for root in coupled.modes(mirror.mirror.A)]
    if what == "modes":
        roots[int(rest[1]) - 1][rest[0] == "frequency"] = expected
    np.testing.assert_allclose(found.mirror.A, lti.modal_matrix([tuple(root) for root in roots]), rtol=1e-12)
    assert found.delay_s == pytest.approx(expected if what == "recording" else 2e-4, abs=1e-18)
    for name in "BEFGCDK":
        matrix = getattr(mirror.mirror, name).copy()
        if what == "matrices" and rest[0] == name:
            matrix[int(rest[1]) - 1, int(rest[2]) - 1] = expected
        np.testing.assert_allclose(getattr(found.mirror, name), matrix, rtol=1e-12)
    assert found.mirror.bank == mirror.mirror.bank and found.actuators == mirror.actuators


def test_what_no_draw_can_make_a_mirror_of_is_refused_in_all_words(monkeypatch):
    known = Known(("modes.decay.1",), np.array([1.0]), np.ones((1, 1)))
    monkeypatch.setattr(coupled.spread, "TRIES", 7)
    monkeypatch.setattr(coupled.spread, "is_one", lambda mirror: False)
    with pytest.raises(ValueError) as refused:
        drawn(replace(handmade(), known=known), 2, 5)
    assert str(refused.value) == (
        "7 draws from the uncertainty of 'by hand' in a row run away, have thresholds out of order or hysteresis "
        "without bound: its standard errors are too large for a mirror; identify it from more records, or leave the "
        "table uncertainty out"
    )
    assert directions(replace(handmade(), known=known)) == 1 and draws(handmade(), 3, 1) == ()


def test_numbers_of_elements_that_all_change_places_stay_with_their_elements():
    """The file has both plays before the Bouc-Wen element, which is the first of the mirror."""
    data = tomllib.loads(coupled.text(handmade()))
    one, two, three = (data["hysteresis"][key] for key in "123")
    data["hysteresis"] = {"1": two, "2": three, "3": one}
    names = [
        *("hysteresis.1.widening", "hysteresis.2.polynomial.3", "hysteresis.3.epsilon"),
        *("matrices.E.2.1", "matrices.K.1.2", "matrices.G.3.1"),
    ]
    data["uncertainty"] = {"parameters": names, "standard_errors": [0.1] * 6, "factor": np.eye(6).tolist()}
    found = coupled.of(Table.model_validate(data))
    assert found.mirror.bank == handmade().mirror.bank
    np.testing.assert_array_equal(found.mirror.E, handmade().mirror.E[:, [2, 0, 1]])
    np.testing.assert_array_equal(found.mirror.G, handmade().mirror.G[[2, 0, 1]])
    assert found.known.parameters == (
        *("hysteresis.2.widening", "hysteresis.3.polynomial.3", "hysteresis.1.epsilon"),
        *("matrices.E.2.2", "matrices.K.1.3", "matrices.G.1.1"),
    )


def test_channels_and_elements_are_counted_by_their_numbers_wherever_they_stand_in_a_file():
    """Eleven plays and three outputs, in a file that begins with the last: the tenth comes behind the ninth."""
    own = handmade()
    plays = tuple(PrandtlIshlinskii((0.0, 1.0 + k), (0.1 + k, 0.01)) for k in range(11))
    plant = replace(
        own.mirror,
        E=np.arange(33.0).reshape(3, 11) / 100,
        F=np.zeros((11, 3)),
        G=np.arange(22.0).reshape(11, 2),
        C=np.arange(9.0).reshape(3, 3),
        D=np.arange(6.0).reshape(3, 2),
        K=np.arange(33.0).reshape(3, 11),
        bouc_wen=(),
        plays=plays,
    )
    outputs = tuple(Output(f"y{k}", "displacement", (0.01 * (k == 1), 0.02 * (k == 2))) for k in range(3))
    mirror = replace(own, mirror=plant, outputs=outputs)
    text = coupled.text(mirror)
    head, *tables = text.split("\n[")
    turned = "\n[".join([head, *reversed(tables)])
    assert turned.index("[hysteresis.11]") < turned.index("[hysteresis.10]") < turned.index("[hysteresis.9]")
    assert turned.index("[actuators.2]") < turned.index("[actuators.1]")
    found = coupled.of(load_coupled_mirror("mirror.toml", text=turned))
    assert found.mirror.plays == plays
    assert [actuator.name for actuator in found.actuators] == ["left", "right"] and found.outputs == outputs
    for name in "ABEGCDK":
        np.testing.assert_array_equal(getattr(found.mirror, name), getattr(plant, name))


def test_a_comment_stays_a_comment_whatever_it_holds():
    text = coupled.text(handmade(), ['of "a"\nname = "other"', "", "tab\tand \x85 end"])
    assert text.startswith('# of "a" name = "other"\n# \n# tab and   end\n# Matrices, weights')
    assert load_coupled_mirror("mirror.toml", text=text).name == "by hand"


@pytest.mark.parametrize("seed", [3, 4])
def test_each_draw_has_the_stream_of_its_seed_and_its_number(seed):
    known = Known(("matrices.D.1.1", "matrices.D.1.2"), np.array([1e-3, 2e-3]), np.eye(2))
    own = replace(handmade(), known=known)
    for number, (found, normals) in enumerate(drawn(own, 3, seed)):
        stream = np.random.Philox(np.random.SeedSequence(seed, spawn_key=(number,)))
        np.testing.assert_array_equal(normals, np.random.Generator(stream).standard_normal(2))
        np.testing.assert_allclose(found.mirror.D, own.mirror.D + normals * known.standard_errors, rtol=1e-12)
        assert draws(own, 3, seed)[number].mirror.D.tolist() == found.mirror.D.tolist()


@pytest.mark.parametrize("change", [-0.25, 0.25])
def test_what_is_0_in_an_element_stays_at_least_0(change):
    """A weight and a threshold of 0, and no widening; a coefficient of 0 may fall."""
    own = handmade()
    bent = replace(own.mirror.plays[1], weights_rad_v=(0.3, 0.0, 0.05), polynomial_rad=(0.7, 0.0, 0.9))
    own = replace(own, mirror=replace(own.mirror, plays=(own.mirror.plays[0], bent)))
    keys = ("2.thresholds.1", "3.weights.2", "3.widening", "3.polynomial.2")
    first, second = changed(own, {f"hysteresis.{key}": change for key in keys}).mirror.plays
    least = max(change, 0.0)
    assert first == replace(own.mirror.plays[0], thresholds_v=(least, 1.5))
    weights, bends = (0.3, least, 0.05), (0.7, change, 0.9)
    assert second == replace(bent, weights_rad_v=weights, widening_s=least, polynomial_rad=bends)


def test_a_correlation_that_rounding_left_indefinite_has_a_factor_of_rows_of_length_one():
    """Three correlations of -0.504 cannot be. The file's second element stands first in the mirror."""
    table = SimpleNamespace(
        factor=None,
        correlation_matrix=np.array([[1.0, -0.504, -0.504], [-0.504, 1.0, -0.504], [-0.504, -0.504, 1.0]]),
        parameters=("hysteresis.1.epsilon", "matrices.E.3.2", "modes.decay.1"),
        standard_errors=(1e-6, 0.2, 3.0),
    )
    known = _known(table, [1, 0])
    assert known.parameters == ("hysteresis.2.epsilon", "matrices.E.3.1", "modes.decay.1")
    assert known.standard_errors.tolist() == [1e-6, 0.2, 3.0]
    np.testing.assert_allclose(np.linalg.norm(known.factor, axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(known.correlation, table.correlation_matrix, atol=0.01)
