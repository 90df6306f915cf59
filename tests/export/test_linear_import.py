"""Linear mirrors of other tools become mirror files that answer as they did, or are refused with the reason."""

import hashlib
import math
import pickle
import re
import struct
import sys
import tomllib
from dataclasses import fields, replace
from types import SimpleNamespace

import control as python_control
import numpy as np
import pytest
from pydantic import ValidationError
from pydantic_core import PydanticCustomError
from scipy.io import loadmat, savemat
from scipy.signal import cont2discrete
from scipy.sparse import csc_array

from microrad.core import lti
from microrad.export import choice, matrices
from microrad.export.linear_import import Given, hold, import_control, import_mat, matlab, mirror_file
from microrad.export.linear_import import roots as roots_module
from microrad.export.matrices.forms import floats, polynomials
from microrad.export.records import ExportError
from microrad.mirror import model as mirror
from microrad.mission.file import load_mirror, load_mission
from places import ROOT
from shipped import SHIPPED

NINE_DIGITS = 1e-9
GIVEN = Given("Our mirror", 2.5e-3, 3770.0, 6.0, 0.0, 12.0, 1.0, 5000.0, 2.0, "rad")
POLES = [-300.0, complex(-40.0, 5000.0), complex(-40.0, -5000.0)]
ZEROS = [complex(-30.0, 6000.0), complex(-30.0, -6000.0)]
GAIN = 2e-5


@pytest.fixture(scope="module")
def models():
    return matrices.models(choice.source(load_mission(SHIPPED)))


def answer(folder, text, freq_hz):
    """Frequency response (rad/V) of what a mirror file says, read as a user's file is."""
    path = folder / "mirror.toml"
    path.write_text(text, encoding="utf-8")
    m = load_mirror(path).mirror
    made = mirror.from_mission(m, mirror.hysteresis_model(m, m.rate_limit_v_s, m.bias_v))
    return lti.frequency_response(made.linear_loop, freq_hz)[:, 0, 0]


def by_roots(freq_hz, zeros=ZEROS, poles=POLES, gain=GAIN):
    s = 2j * np.pi * freq_hz
    up, down = (np.prod(s[:, None] - np.array(each).reshape(1, -1), axis=1) for each in (zeros, poles))
    return gain * up / down


def difference(found, wanted):
    return np.max(np.abs(found / wanted - 1.0))


BAND = np.geomspace(0.01, 1e5, 300)
STATES = lti.StateSpace(
    np.array([[-300.0, 0, 0], [0, -40.0, 5000.0], [0, -5000.0, -40.0]]),
    np.array([[1.0], [1.0], [0.0]]),
    np.array([[2e-2, 1e-3, 2e-2]]),
    np.zeros((1, 1)),
)
SHAPES = {
    "states": {key: getattr(STATES, key) for key in "ABCD"},
    "roots": {"z": np.array(ZEROS)[:, None], "p": np.array(POLES)[:, None], "k": GAIN},
    "coefficients": {"num": np.poly(ZEROS).real * GAIN, "den": np.poly(POLES).real},
}
cell = np.empty((1, 1), dtype=object)
cell[0, 0] = np.array(POLES)[:, None]
other = np.empty((1, 1), dtype=object)
other[0, 0] = np.array(ZEROS)[:, None]
SHAPES["cells"] = {"z": other, "p": cell, "k": GAIN}


def save(folder, **variables):
    path = folder / "model.mat"
    savemat(path, variables)
    return path


# ----------------------------------------------------------------------------------------------------------- round trip
def test_mirror_of_the_mission_through_mat_and_mirror_file(models, tmp_path):
    matrices.write_mat(models, tmp_path / "models.mat")
    found = answer(tmp_path, import_mat(tmp_path / "models.mat", GIVEN, "mirror"), BAND)
    whole = models[1].system
    assert difference(found, lti.frequency_response(whole, BAND)[:, 0, 0]) < NINE_DIGITS
    part = lti.frequency_response(models[0].system, BAND)[:, 0, 0]
    assert difference(found / found[0], part / part[0]) < NINE_DIGITS
    assert abs(found[0]) > 0.0 and difference(found, part) > 0.1  # rad/V is no ratio


@pytest.mark.promise("mirror-file-56")
@pytest.mark.promise("export-38")
def test_mirror_of_the_mission_through_python_control(models, tmp_path):
    text = import_control(matrices.to_control(models[1]), GIVEN, "our export")
    wanted = lti.frequency_response(models[1].system, BAND)[:, 0, 0]
    assert difference(answer(tmp_path, text, BAND), wanted) < NINE_DIGITS
    assert "imported from our export" in text


@pytest.mark.promise("mirror-file-53", "mirror-file-54")
@pytest.mark.promise("export-36")
@pytest.mark.parametrize("where", ["variables", "structure", "sampled at 0"])
@pytest.mark.parametrize("shape", list(SHAPES))
def test_every_form_gives_its_own_response(shape, where, tmp_path):
    fields = dict(SHAPES[shape])
    if where == "sampled at 0":
        fields["Ts"] = 0.0
    path = save(tmp_path, s=fields) if where == "structure" else save(tmp_path, **fields)
    found = answer(tmp_path, import_mat(path, GIVEN), BAND)
    wanted = lti.frequency_response(STATES, BAND)[:, 0, 0] if shape == "states" else by_roots(BAND)
    assert difference(found, wanted) < NINE_DIGITS


@pytest.mark.promise("mirror-file-61")
def test_what_the_line_for_matlab_saves_is_taken(tmp_path):
    page = (ROOT / "docs" / "mirror-file.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"(?m)^    (s = struct\(.*)$", page)
    fields = dict.fromkeys(re.findall(r"'(\w+)', sys\.\1\b", line), STATES)
    assert fields.keys() == {"A", "B", "C", "D", "Ts"} and line.endswith("save('model.mat', 's', '-v7')")
    saved = {name: getattr(states, name, 0.0) for name, states in fields.items()}  # Ts of a continuous system
    savemat(tmp_path / "model.mat", {"s": saved}, do_compression=True)  # as -v7 does
    wanted = lti.frequency_response(STATES, BAND)[:, 0, 0]
    assert difference(answer(tmp_path, import_mat(tmp_path / "model.mat", GIVEN), BAND), wanted) < NINE_DIGITS


@pytest.mark.promise("mirror-file-56")
@pytest.mark.promise("export-38")
def test_transfer_function_of_python_control(tmp_path):
    system = python_control.tf(np.poly(ZEROS).real * GAIN, np.poly(POLES).real)
    assert difference(answer(tmp_path, import_control(system, GIVEN), BAND), by_roots(BAND)) < NINE_DIGITS


# ------------------------------------------------------------------------------------------------------ sampled models
PERIOD_S = 2e-5
INSIDE = np.geomspace(1.0, 0.49 / PERIOD_S, 200)


def held_by_scipy(system):
    """The system behind a hold, as SciPy samples it."""
    A, B, C, D, _ = cont2discrete((system.A, system.B, system.C, system.D), PERIOD_S, method="zoh")
    return lti.StateSpace(A, B, C, D)


def coefficients(system):
    """Numerator and denominator, each coefficient rounded once, and what that does to the response, relative."""
    num, den = map(floats, polynomials(system))
    z = np.exp(2j * np.pi * INSIDE * PERIOD_S)
    lost = sum(np.sum(np.abs(each)) / np.abs(np.polyval(each, z)) for each in (num, den))
    return num[None], den[None], np.finfo(float).eps * np.max(lost)


@pytest.mark.promise("mirror-file-57")
@pytest.mark.promise("export-37")
@pytest.mark.parametrize("shape", ["states", "roots", "coefficients", "python-control"])
def test_a_sampled_model_becomes_the_continuous_one_behind_its_hold(shape, tmp_path):
    """There and back: sampled by SciPy, imported, the response is that of the model it was."""
    held = held_by_scipy(STATES)
    num, den, lost = coefficients(held)
    if shape == "python-control":
        text = import_control(python_control.ss(held.A, held.B, held.C, held.D, PERIOD_S), GIVEN)
    elif shape == "states":
        text = import_mat(save(tmp_path, **{key: getattr(held, key) for key in "ABCD"}, Ts=PERIOD_S), GIVEN)
    elif shape == "roots":
        found = {"z": np.roots(num[0])[:, None], "p": np.linalg.eigvals(held.A)[:, None], "k": num[0, 0]}
        text = import_mat(save(tmp_path, **found, Ts=PERIOD_S), GIVEN)
    else:
        text = import_mat(save(tmp_path, num=num, den=den, Ts=PERIOD_S), GIVEN)
    wanted = lti.frequency_response(STATES, INSIDE)[:, 0, 0]
    assert lost < NINE_DIGITS
    assert difference(answer(tmp_path, text, INSIDE), wanted) < 10.0 * lost
    assert f"sampled there, Ts = {PERIOD_S!r} s; its drive counts as held" in text


def test_a_sampled_model_is_not_taken_for_one_without_its_hold(tmp_path):
    """Bilinear or by matched poles the response is another: 0.1 at a fifth of the rate."""
    held = held_by_scipy(STATES)
    text = import_mat(save(tmp_path, **{key: getattr(held, key) for key in "ABCD"}, Ts=PERIOD_S), GIVEN)
    freq = np.array([0.2 / PERIOD_S])
    sampled = lti.frequency_response(held, freq, PERIOD_S)[:, 0, 0]
    assert difference(answer(tmp_path, text, freq), sampled) > 0.1


@pytest.mark.parametrize("zeros", [[], ZEROS])
def test_a_sampled_model_has_no_zeros_that_rounding_made(zeros, tmp_path):
    """Held and sampled any model has a zero less than poles; the continuous one has those that it had."""
    gain = 3e9 if not zeros else GAIN
    p = np.array(POLES)
    up = [np.prod(each - np.array(zeros)) / np.prod(each - p[p != each]) for each in p]
    num, den, lost = coefficients(held_by_scipy(lti.modal_from_residues(p, gain * np.array(up))))
    assert (num.size, den.size) == (3, 4)
    text = import_mat(save(tmp_path, num=num, den=den, Ts=PERIOD_S), GIVEN)
    (tmp_path / "mirror.toml").write_text(text, encoding="utf-8")
    found = load_mirror(tmp_path / "mirror.toml").mirror.linear
    assert len(found.zeros_hz or ()) == len(zeros) // 2
    assert difference(answer(tmp_path, text, INSIDE), by_roots(INSIDE, zeros, POLES, gain)) < 10.0 * lost


def test_a_mode_beyond_a_quarter_of_the_rate_is_taken(tmp_path):
    """Its poles have a negative real part, and are no single one that turns its sign each sample."""
    pole = 2.0 * math.pi * 15e3 * complex(-0.3, 1.0)
    mode = lti.modal_from_residues(np.array([pole, pole.conjugate()]), np.array([-1e4j, 1e4j]))
    held = held_by_scipy(mode)
    assert np.all(np.linalg.eigvals(held.A).real < 0.0)
    text = import_mat(save(tmp_path, **{key: getattr(held, key) for key in "ABCD"}, Ts=PERIOD_S), GIVEN)
    assert difference(answer(tmp_path, text, INSIDE), lti.frequency_response(mode, INSIDE)[:, 0, 0]) < NINE_DIGITS


def test_rounding_of_full_matrices_makes_no_zeros_either(tmp_path):
    """At 500 kHz it leaves more of a leading coefficient than the exact arithmetic behind it takes for nothing."""
    p = np.array(POLES)
    made = lti.modal_from_residues(p, np.array([3e9 / np.prod(each - p[p != each]) for each in p]))
    A, B, C, D, _ = cont2discrete((made.A, made.B, made.C, made.D), 2e-6, method="zoh")
    Q = np.random.default_rng(1).normal(size=(3, 3))
    back = np.linalg.inv(Q)
    text = import_mat(save(tmp_path, A=Q @ A @ back, B=Q @ B, C=C @ back, D=D, Ts=2e-6), GIVEN)
    assert "zeros" not in text and "poles" in text


@pytest.mark.parametrize(("unit", "scale"), [("rad", 1.0), ("mrad", 1e-3), ("urad", 1e-6)])
def test_output_counts_in_the_unit_that_is_given(unit, scale, tmp_path):
    text = import_mat(save(tmp_path, **SHAPES["roots"]), replace(GIVEN, output_unit=unit))
    assert difference(answer(tmp_path, text, BAND), scale * by_roots(BAND)) < NINE_DIGITS
    assert f" {unit}/V" in text


def test_a_negative_factor_is_no_falling_mirror(tmp_path):
    """A zero in the right half plane: k is below 0 and the answer to a constant drive above it."""
    fields = {"z": np.array([[4e4]]), "p": np.array(POLES)[:, None], "k": -3.0}
    text = import_mat(save(tmp_path, **fields), GIVEN)
    assert "zero_dampings = [-1.0]" in text
    assert difference(answer(tmp_path, text, BAND), by_roots(BAND, [4e4], POLES, -3.0)) < NINE_DIGITS


@pytest.mark.promise("mirror-file-53", "mirror-file-55", "mirror-file-57")
@pytest.mark.promise("export-36")
def test_what_is_given_stands_in_the_file_and_what_it_came_from(tmp_path):
    path = save(tmp_path, **SHAPES["roots"])
    text = import_mat(path, replace(GIVEN, name='A "quoted" name'))
    (tmp_path / "mirror.toml").write_text(text, encoding="utf-8")
    found = load_mirror(tmp_path / "mirror.toml")
    m = found.mirror
    assert m.name == 'A "quoted" name' and m.travel_rad == 2.5e-3 and m.rate_limit_v_s == 3770.0
    assert (m.bias_v, m.drive_min_v, m.drive_max_v) == (6.0, 0.0, 12.0)
    assert (m.linear.excited_from_hz, m.linear.excited_to_hz, m.linear.normalise_at_hz) == (1.0, 5000.0, 2.0)
    assert m.prandtl_ishlinskii.thresholds_v == (0.0,) and m.bouc_wen is None and m.creep is None
    assert text.startswith("# Mirror imported from model.mat:") and str(tmp_path) not in text
    assert hashlib.sha256(path.read_bytes()).hexdigest() in text
    assert "imported from model.mat" in found.sources["mirror.linear.poles"].comment
    assert "given on import" in found.sources["mirror.travel"].comment


# ------------------------------------------------------------------------------------------------------------- choosing
def test_one_of_several_systems_is_chosen_by_its_name(tmp_path):
    first, second = dict(SHAPES["roots"]), {**SHAPES["roots"], "k": 3.0 * GAIN}
    path = save(tmp_path, first=first, second=second, note="text")
    with pytest.raises(ExportError, match=r"model\.mat holds 2 systems, 'first', 'second'; choose one by its name$"):
        import_mat(path, GIVEN)
    assert difference(answer(tmp_path, import_mat(path, GIVEN, "second"), BAND), 3.0 * by_roots(BAND)) < NINE_DIGITS
    with pytest.raises(ExportError, match="has no system 'third'; it has 'first', 'second'"):
        import_mat(path, GIVEN, "third")


def test_variables_of_their_own_beside_a_structure_go_by_no_name(tmp_path):
    path = save(tmp_path, **SHAPES["roots"], s={**SHAPES["roots"], "k": 3.0 * GAIN})
    with pytest.raises(ExportError, match=r"holds 2 systems, '', 's'"):
        import_mat(path, GIVEN)
    assert difference(answer(tmp_path, import_mat(path, GIVEN, ""), BAND), by_roots(BAND)) < NINE_DIGITS


def test_states_count_where_there_are_several_forms(tmp_path):
    path = save(tmp_path, **SHAPES["states"], **SHAPES["roots"])
    wanted = lti.frequency_response(STATES, BAND)[:, 0, 0]
    assert difference(answer(tmp_path, import_mat(path, GIVEN), BAND), wanted) < NINE_DIGITS
    assert difference(wanted, by_roots(BAND)) > 0.1


@pytest.mark.promise("mirror-file-53")
def test_linear_part_alone_has_no_drive_in_volts(models, tmp_path):
    matrices.write_mat(models, tmp_path / "models.mat")
    with pytest.raises(ExportError, match=r"its input is in rad, and a mirror's drive is in V"):
        import_mat(tmp_path / "models.mat", GIVEN, "linear_part")


@pytest.mark.parametrize("unit", ["V", "", 3.0, np.array(["rad", "rad"], dtype=object)])
def test_an_input_in_volts_or_in_no_unit_is_taken(tmp_path, unit):
    path = save(tmp_path, **SHAPES["roots"], InputUnit=unit)
    assert difference(answer(tmp_path, import_mat(path, GIVEN), BAND), by_roots(BAND)) < NINE_DIGITS


# ------------------------------------------------------------------------------------------------------------- refusals
def roots(poles=POLES, zeros=ZEROS, k=GAIN, **more):
    column = {key: np.array(each, dtype=complex).reshape(-1, 1) for key, each in (("z", zeros), ("p", poles))}
    return {**column, "k": k, **more}


def states(**changed):
    return {**SHAPES["states"], **changed}


def sampled_roots(poles, zeros=()):
    return roots(poles, zeros, 1e-3, Ts=2e-5)


TWO = {"A": -np.eye(2), "B": np.eye(2), "C": np.ones((1, 2)), "D": np.zeros((1, 2))}
HIDING = {"A": np.diag([-1.0, -20.0]), "B": np.array([[1.0], [0.0]]), "C": np.ones((1, 2)), "D": np.zeros((1, 1))}


@pytest.mark.promise("mirror-file-53")
@pytest.mark.promise("export-36", "export-37")
@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({}, r"has no linear system; it holds nothing, and none with A B C D, z p k or num den"),
        ({"note": "text"}, r"has no linear system; it holds note, and none with A B C D, z p k or num den"),
        ({"A": np.eye(2)}, r"has no linear system; it holds A"),
        ({"s": np.array([(1, 2), (3, 4)], dtype=[("num", "O"), ("den", "O")])}, "an array of 2 structures"),
        (TWO, "2 inputs and 1 output; a mirror file has one drive and one angle"),
        (states(B=np.ones((4, 1))), r"B has shape \(4, 1\), where \(3, 1\) fits"),
        (states(A=np.ones((3, 2))), r"A has shape \(3, 2\), where \(3, 3\) fits"),
        (states(A=STATES.A + 1j), "A holds complex numbers"),
        (states(A=STATES.A * 1e200), "A holds a number that is not finite or beyond 1e\\+100"),
        (roots(poles=[-1e90, -2e90, -3e90, -4e90, -5e90], zeros=[]), "cannot be divided out"),
        ({"num": [[1.0]], "den": [[1.0, 1e300]]}, "den holds a number that is not finite or beyond"),
        (states(A=csc_array(STATES.A)), "A is a sparse matrix"),
        (states(C="text"), "C is not a matrix of numbers"),
        (states(A=np.ones((3, 3, 2))), "A is not a matrix of numbers"),
        (states(InputUnit="rad"), "its input is in rad, and a mirror's drive is in V"),
        (states(C=np.array([[1.0, math.nan, 0.0]])), "C holds a number that is not finite"),
        (
            states(A=-np.diag(np.arange(1.0, 62.0)), B=np.ones((61, 1)), C=np.ones((1, 61))),
            "61 states, and a mirror has",
        ),
        (states(D=np.ones((1, 1))), "3 zeros over 3 poles, not strictly proper"),
        (states(C=np.zeros((1, 3))), "not minimal, it has a mode that no output shows"),
        (HIDING, r"no input drives: 3\.183 Hz"),
        (states(Ts=-1.0), "sampled, Ts = -1 s, which is no time"),
        (states(Ts=np.zeros((2, 2))), "sampled, Ts = nan s"),
        (states(Ts=math.inf), "Ts holds a number that is not finite"),
        (states(Ts=2e-3), "the band ends at 5000 Hz, .* says nothing beyond 250 Hz"),
        (states(Ts=1.01e-4), r"the band ends at 5000 Hz, .* says nothing beyond 4950\.5 Hz"),
        (sampled_roots([1.1, 0.5]), r"unstable, a pole at \|z\| = 1\.1 at 0 Hz"),
        (sampled_roots([1.0, 0.5]), r"an integrator, a pole at \|z\| = 1 at 0 Hz"),
        (sampled_roots([-0.4, 0.9]), r"negative real axis, \|z\| = 0\.4 at 2\.5e\+04 Hz, turns its sign"),
        (sampled_roots([complex(-0.9, 1e-8), complex(-0.9, -1e-8)]), r"negative real axis, \|z\| = 0\.9 at 2\.5e"),
        (sampled_roots([0.0, 0.9]), "a pole at 0, a delay of a whole sample"),
        (sampled_roots([0.5, 0.5]), r"two poles coincide, \|z\| = 0\.5"),
        (sampled_roots([0.5], [0.2]), "1 zero over 1 pole, its output follows the drive within a sample"),
        (
            states(Ts=2e-5, A=np.diag([0.4, 0.5, 0.6]), B=np.ones((3, 1)), C=np.ones((1, 3)), D=np.ones((1, 1))),
            "within a sample",
        ),
        (sampled_roots([0.5, 0.5 + 2e-8, 0.5 + 5e-8]), "no continuous model gives it within 1e-09"),
        (roots(k=np.ones((2, 1))), "k has 2 gains"),
        (roots(k=math.inf), "k holds a number that is not finite"),
        (roots(k=0.0), "a gain of 0.0; the mirror does not move"),
        ({"num": [[1e100]], "den": [[1e-250, 1.0]]}, "a gain of inf; the mirror does not move"),
        (roots(poles=[-300.0, -5.0 + 3.0j], zeros=[]), r"p has the complex root -5\+3j without its conjugate"),
        (roots(poles=[-300.0, -5.0 - 3.0j], zeros=[]), r"p has the complex root -5-3j without its conjugate"),
        (roots(zeros=[-5.0 + 3.0j, -5.1 - 3.0j]), "z has the complex root"),
        (roots(zeros=[]) | {"p": np.ones((2, 2))}, r"p has shape \(2, 2\), not a row or a column"),
        (roots(poles=[300.0, -400.0], zeros=[]), r"unstable, a pole at 47\.75 Hz with a damping ratio of -1"),
        (roots(poles=[3000.0j, -3000.0j], zeros=[]), r"unstable, a pole at 477\.5 Hz with a damping ratio of -?0"),
        (roots(poles=[0.0, -300.0], zeros=[]), "an integrator, a pole at 0 Hz"),
        (roots(poles=[-300.0, -300.0], zeros=[]), r"two poles coincide at 47\.75 Hz"),
        (roots(poles=[-300.0, -300.0 * (1 + 1e-8)], zeros=[], k=9.0), "differ from the model by .* nearly coincide"),
        (roots(poles=[-300.0, -600.0], zeros=[-300.0]), r"not minimal, a zero cancels the pole at 47\.75 Hz"),
        (
            roots(poles=[-300.0, -600.0], zeros=[-300.0 * (1 + 2e-9)]),
            r"not minimal, a zero cancels the pole at 47\.75 Hz",
        ),
        (roots(zeros=[0.0]), "a zero at 0 Hz: the mirror does not hold an angle"),
        (roots(k=-GAIN), "the output falls as the drive rises"),
        ({"num": [[1.0, 2.0]], "den": [[1.0, 2.0]]}, "1 zero over 1 pole, not strictly proper"),
        ({"num": [[1.0, 2.0, 1.0]], "den": [[1.0, 2.0]]}, "2 zeros over 1 pole, not strictly proper"),
        ({"num": [[0.0]], "den": [[1.0, 2.0]]}, "the numerator is zero"),
        ({"num": [[1.0]], "den": [[0.0, 0.0]]}, "the denominator is zero"),
        ({"num": [[1.0]], "den": np.ones((1, 62))}, "order 61, and a mirror has at most 60"),
        ({"num": [[1.0]], "den": [[1.0, 2.0, 0.0]]}, "an integrator, a pole at 0 Hz"),
        ({"num": [[1.0]], "den": [[1.0, 2.0 + 1.0j]]}, "den holds complex numbers"),
        (
            {"num": np.array([[0, 0]], dtype=object), "den": np.array([[1, 2]], dtype=object)},
            "num has cells for 2 entries",
        ),
        (
            roots(zeros=[2j * np.pi * 2.0, -2j * np.pi * 2.0]),
            r"response at normalise_at \(2 Hz\) is .* cannot be divided",
        ),
    ],
)
def test_what_is_no_linear_mirror_is_refused(fields, why, tmp_path):
    with pytest.raises(ExportError, match=why) as error:
        import_mat(save(tmp_path, **fields), GIVEN)
    assert "model.mat" in str(error.value)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"name": "  "}, "the mirror has no name"),
        ({"travel_rad": math.nan}, "travel_rad = nan is not finite"),
        ({"output_unit": "deg"}, "output_unit = 'deg' is none of rad, mrad, urad"),
        ({"travel_rad": -1.0}, r"the mirror file would be refused: travel: .*not above 0"),
        ({"bias_v": 20.0}, r"would be refused: .*bias is outside drive_min to drive_max"),
        ({"normalise_at_hz": 0.5}, r"the gain is taken at 0\.5 Hz .*not in the band of 1 Hz to 5000 Hz"),
        ({"normalise_at_hz": 9000.0}, r"the gain is taken at 9000 Hz .*not in the band of 1 Hz to 5000 Hz"),
        ({"excited_from_hz": 5000.0}, r"the band begins at 5000 Hz and ends at 5000 Hz; give its lower end first"),
        ({"excited_from_hz": 9000.0}, r"the band begins at 9000 Hz and ends at 5000 Hz; give its lower end first"),
        ({"drive_min_v": 12.0, "drive_max_v": 0.0}, r"would be refused: drive_max is not above drive_min"),
        ({"name": "x" * 201}, "would be refused: name: "),
    ],
)
def test_what_is_given_wrongly_is_refused(change, why, tmp_path):
    with pytest.raises(ExportError, match=why):
        import_mat(save(tmp_path, **SHAPES["roots"]), replace(GIVEN, **change))


def test_the_gain_may_be_taken_at_the_ends_of_the_band_and_all_refusals_are_told(tmp_path):
    path = save(tmp_path, **SHAPES["roots"])
    for at in (GIVEN.excited_from_hz, GIVEN.excited_to_hz):
        (tmp_path / "mirror.toml").write_text(import_mat(path, replace(GIVEN, normalise_at_hz=at)), encoding="utf-8")
        assert load_mirror(tmp_path / "mirror.toml").mirror.linear.normalise_at_hz == at
    with pytest.raises(ExportError, match=r"would be refused: (name: .*; travel: |travel: .*; name: )"):
        import_mat(path, replace(GIVEN, travel_rad=-1.0, name="x" * 201))


def test_a_band_may_end_at_half_the_rate_of_a_sampled_model(tmp_path):
    A, B, C, D, _ = cont2discrete((STATES.A, STATES.B, STATES.C, STATES.D), 1e-4, method="zoh")
    text = import_mat(save(tmp_path, A=A, B=B, C=C, D=D, Ts=1e-4), GIVEN)
    wanted = lti.frequency_response(STATES, INSIDE[INSIDE < 4.9e3])[:, 0, 0]
    assert difference(answer(tmp_path, text, INSIDE[INSIDE < 4.9e3]), wanted) < NINE_DIGITS


def test_a_model_of_the_highest_order_is_taken_and_one_more_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(roots_module, "MOST_ORDER", 3)
    assert import_mat(save(tmp_path, **SHAPES["coefficients"]), GIVEN)
    assert import_mat(save(tmp_path, **SHAPES["states"]), GIVEN)
    monkeypatch.setattr(roots_module, "MOST_ORDER", 2)
    with pytest.raises(ExportError, match="order 3, and a mirror has at most 2; reduce the model"):
        import_mat(save(tmp_path, **SHAPES["coefficients"]), GIVEN)
    with pytest.raises(ExportError, match="3 states, and a mirror has at most 2; reduce the model"):
        import_mat(save(tmp_path, **SHAPES["states"]), GIVEN)


def test_a_file_has_so_many_bytes_and_no_more_and_is_there(tmp_path, monkeypatch):
    path = save(tmp_path, **SHAPES["roots"])
    size = path.stat().st_size
    monkeypatch.setattr(matlab, "MOST_BYTES", size)
    assert import_mat(path, GIVEN)
    monkeypatch.setattr(matlab, "MOST_BYTES", size - 1)
    with pytest.raises(ExportError, match=f"has {size} bytes; a linear model has at most {size - 1}: is it a rec"):
        import_mat(path, GIVEN)
    with pytest.raises(ExportError, match=r"none\.mat cannot be read \(No such file or directory\); check the path"):
        import_mat(tmp_path / "none.mat", GIVEN)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_number_may_be_as_large_as_those_of_a_mission(sign):
    assert matlab.numbers({"k": np.array([[sign * 1e100]])}, "k", "m").item() == sign * 1e100
    for value in (sign * 1.001e100, sign * math.inf, math.nan):
        with pytest.raises(ExportError, match="m: k holds a number that is not finite or beyond 1e\\+100"):
            matlab.numbers({"k": np.array([[value]])}, "k", "m")


def test_a_name_of_several_lines_adds_none_to_the_file():
    system = python_control.tf(np.poly(ZEROS).real * GAIN, np.poly(POLES).real)
    text = import_control(system, GIVEN, "our\nbias = 1\x1b[0m\u2028model")
    assert "imported from our bias = 1 [0m model" in text
    assert text.count("\n") == import_control(system, GIVEN, "our model").count("\n")


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


@pytest.mark.promise("mirror-file-53")
def test_objects_of_matlab_are_refused_with_what_to_save(tmp_path):
    """MATLAB saves `ss` as an object of its own, whose format is not published."""
    parts = ((6, struct.pack("<II", 17, 0)), (1, b"sys"), (1, b"MCOS"), (1, b"ss"))
    data = element(14, b"".join(element(*part) for part in parts))
    (tmp_path / "model.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + data)
    with pytest.raises(ExportError, match=r"variable 'sys' is an object of MATLAB.*struct\('A', sys\.A"):
        import_mat(tmp_path / "model.mat", GIVEN)


def test_pickles_are_not_opened(tmp_path):
    class Trap:
        def __reduce__(self):
            return (tmp_path.joinpath("sprung").write_text, ("x",))

    (tmp_path / "model.mat").write_bytes(pickle.dumps(Trap()).ljust(400))
    with pytest.raises(ExportError, match="no MATLAB file that can be read"):
        import_mat(tmp_path / "model.mat", GIVEN)
    assert not (tmp_path / "sprung").exists()


@pytest.mark.promise("mirror-file-56")
@pytest.mark.parametrize(
    ("system", "why"),
    [
        (python_control.ss(-np.eye(2), np.eye(2), np.eye(2), 0), "2 inputs and 2 outputs"),
        (python_control.tf([[[1.0], [2.0]]], [[[1.0, 5.0], [1.0, 6.0]]]), "2 inputs and 1 output"),
        (python_control.tf([[[1.0]], [[2.0]]], [[[1.0, 5.0]], [[1.0, 6.0]]]), "1 input and 2 outputs"),
        (python_control.tf([1.0], [1.0, -0.5], 0.01), "the band ends at 5000 Hz"),
        (python_control.tf([1.0], [1.0, -0.5], None), "dt = None: continuous, or sampled how fast"),
        (python_control.tf([1.0], [1.0, -0.5], True), "dt = True: continuous, or sampled how fast"),
        (python_control.tf([1.0, 0.0, 0.0], [1.0, 1.0]), "2 zeros over 1 pole, not strictly proper"),
        (python_control.tf([1.0], [1.0, -5.0]), "unstable, a pole at 0.7958 Hz"),
        (python_control.frd([1.0, 2.0], [1.0, 2.0]), "a FrequencyResponseData; give a control.StateSpace or"),
        (SimpleNamespace(A=1), "a SimpleNamespace; give a control.StateSpace or"),
    ],
)
def test_objects_that_are_no_linear_mirror_are_refused(system, why):
    with pytest.raises(ExportError, match=f"bench: .*{why}|{why}"):
        import_control(system, GIVEN, "bench")


@pytest.mark.promise("mirror-file-56")
def test_without_python_control_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ExportError, match=r"constraints.txt '\.\[control\]'"):
        import_control(object(), GIVEN)


@pytest.mark.promise("mirror-file-57")
def test_a_mirror_file_that_says_something_else_is_never_returned(tmp_path, monkeypatch):
    path = save(tmp_path, **SHAPES["roots"])
    assert import_mat(path, GIVEN)
    monkeypatch.setattr(mirror_file, "READ_BACK", 1e-18)
    with pytest.raises(ExportError, match="the mirror file would differ from the model"):
        import_mat(path, GIVEN)


@pytest.mark.promise("mirror-file-57")
def test_a_mirror_file_is_compared_from_a_tenth_of_the_band_to_ten_times_its_end(tmp_path, monkeypatch):
    seen = []
    own = mirror_file.frequency_response
    monkeypatch.setattr(mirror_file, "frequency_response", lambda m, freq: (seen.append(freq), own(m, freq))[1])
    import_mat(save(tmp_path, **SHAPES["roots"]), GIVEN)
    (freq,) = seen
    assert (freq[0], freq[-1]) == pytest.approx((0.1, 50e3), rel=1e-12) and len(freq) == 200
    assert mirror_file.READ_BACK == 1e-9


@pytest.mark.promise("mirror-file-55")
def test_nothing_that_is_given_has_a_value_of_its_own():
    names = [each.name for each in fields(Given)]
    assert names[0] == "name" and names[-1] == "output_unit"
    whole = {name: getattr(GIVEN, name) for name in names}
    for name in names:
        with pytest.raises(TypeError, match=f"missing 1 required positional argument: '{name}'"):
            Given(**{key: value for key, value in whole.items() if key != name})


def test_scipy_sees_the_same_file(tmp_path):
    """The test's own files are what MATLAB would write: structures of one element."""
    path = save(tmp_path, s=SHAPES["states"])
    assert loadmat(path)["s"].shape == (1, 1)


# ------------------------------------------------------------------------------------ whole texts and whole messages
UNLIKE = Given('Tip & "tilt"', 1.5e-3, 250.0, 2.5, -1.0, 7.5, 0.75, 400.0, 12.5, "urad")


def test_a_mirror_file_has_each_root_and_each_number_given_on_its_own_line(tmp_path):
    """Roots that are not in their order: a pair above a real pole, a real zero in the right half plane."""
    poles = [complex(-60.0, 800.0), complex(-60.0, -800.0), -500.0, -200.0]
    fields = roots(poles=poles, zeros=[3000.0, -1000.0], k=-4.0)
    text = import_mat(save(tmp_path, **fields), UNLIKE)
    digest = hashlib.sha256((tmp_path / "model.mat").read_bytes()).hexdigest()
    text = re.sub(r"\d+\.\d{6,}", lambda found: f"{float(found[0]):.6g}", text.replace(digest, "(digest)"))
    assert text.split("\n") == [
        "# Mirror imported from model.mat: linear, without hysteresis or creep.",
        "#   sha256 (digest)",
        'name = "Tip & \\"tilt\\""',
        'travel = "0.0015 rad"                        # given on import, no linear model says it',
        'composition = "cascade"                      # the linear part behind a straight gain',
        'rate_limit = "250.0 V/s"                     # given on import, no linear model says it',
        'bias = "2.5 V"                               # given on import, no linear model says it',
        'drive_min = "-1.0 V"                         # given on import, no linear model says it',
        'drive_max = "7.5 V"                          # given on import, no linear model says it',
        "",
        "[linear]",
        'poles = ["31.831 Hz", "79.5775 Hz", "127.682 Hz"] # imported from model.mat',
        "pole_dampings = [1.0, 1.0, 0.0747899] # imported from model.mat; 1 is a real pole",
        'zeros = ["159.155 Hz", "477.465 Hz"] # imported from model.mat',
        "zero_dampings = [1.0, -1.0] # imported from model.mat; 1 is a real zero",
        ('normalise_at = "12.5 Hz"                     # given on import: where the gain below is taken'),
        'excited_from = "0.75 Hz"                     # given on import, no linear model says it',
        'excited_to = "400.0 Hz"                      # given on import, no linear model says it',
        "",
        "[prandtl_ishlinskii]",
        'thresholds = ["0 V"]                         # no hysteresis: the linear model has none',
        'weights = ["0.00017368 urad/V"]  # its size at normalise_at, imported from model.mat',
        "",
    ]


def test_a_sampled_model_of_a_structure_says_how_it_was_sampled_and_which_it_is(tmp_path):
    text = import_mat(save(tmp_path, first=1.0, tip=sampled_roots([0.9, 0.5])), replace(UNLIKE, output_unit="mrad"))
    told = [line for line in text.split("\n") if line.startswith(("#", "name"))]
    assert [line for line in told if "sha256" not in line] == [
        "# Mirror imported from model.mat, tip: linear, without hysteresis or creep.",
        "#   sampled there, Ts = 2e-05 s; its drive counts as held over each sample",
        'name = "Tip & \\"tilt\\""',
    ]


REFUSED = {
    "two poles coincide": roots(poles=[-300.0, -300.0], zeros=[]),
    "a zero cancels": roots(poles=[-300.0, -600.0], zeros=[-600.0]),
    "unstable": roots(poles=[-900.0, 300.0, -400.0], zeros=[]),
    "an integrator": roots(poles=[-300.0, 0.0], zeros=[]),
    "no conjugate": roots(poles=[-300.0, complex(-5.0, 3.0)], zeros=[]),
    "falling": roots(k=-GAIN),
    "a zero at rest": roots(zeros=[0.0]),
    "no gain": roots(k=0.0),
    "gains": roots(k=np.ones((1, 3))),
    "a jump": roots(poles=[-300.0], zeros=[-200.0, -100.0]),
    "a matrix of roots": roots(zeros=[]) | {"p": np.ones((2, 3))},
    "channels": {"A": -np.eye(2), "B": np.eye(2), "C": np.ones((3, 2)), "D": np.zeros((3, 2))},
    "shapes": states(D=np.zeros((1, 2))),
    "hidden": HIDING,
    "no time": states(Ts=-0.5),
    "the band": states(Ts=4e-3),
    "a whole sample": sampled_roots([0.0, 0.9]),
    "sampled unstable": sampled_roots([0.3, 1.25]),
    "sampled integrator": sampled_roots([0.3, 1.0]),
    "sampled alike": sampled_roots([0.25, 0.25]),
    "sampled sign": sampled_roots([-0.4, 0.9]),
    "sampled jump": sampled_roots([0.5, 0.25], [0.2, 0.1]),
    "sampled near": sampled_roots([0.5, 0.5 + 2e-8, 0.5 + 5e-8]),
    "an input": states(InputUnit="rad"),
    "no denominator": {"num": [[1.0]], "den": [[0.0, 0.0]]},
    "no numerator": {"num": [[0.0]], "den": [[1.0, 2.0]]},
    "an order": {"num": [[1.0]], "den": np.ones((1, 64))},
    "complex numbers": {"num": [[1.0]], "den": [[1.0, 2.0 + 1.0j]]},
    "not finite": states(C=np.array([[1.0, math.nan, 0.0]])),
    "text": states(C="text"),
    "sparse": states(A=csc_array(STATES.A)),
    "cells": {"num": np.array([[0, 0, 1]], dtype=object), "den": np.array([[1, 2]], dtype=object)},
    "nothing": {"note": "text", "other": 2.0},
    "structures": {"s": np.array([(1, 2), (3, 4), (5, 6)], dtype=[("num", "O"), ("den", "O")])},
    "two systems": {"s": roots(), "t": roots()},
    "bare and structure": {"s": roots(), **roots()},
}


def message(folder, fields, given=GIVEN, **more):
    with pytest.raises(ExportError) as error:
        import_mat(save(folder, **fields), given, **more)
    return str(error.value).replace(str(folder), "(folder)")


def test_each_refusal_says_what_was_found_where_and_what_to_do(tmp_path):
    assert {name: message(tmp_path, fields) for name, fields in REFUSED.items()} == {
        "two poles coincide": (
            "(folder)/model.mat: two poles coincide at 47.75 Hz with a damping ratio of 1; a "
            "mirror file has no modal form for them: set them apart, or reduce the model"
        ),
        "a zero cancels": (
            "(folder)/model.mat: not minimal, a zero cancels the pole at 95.49 Hz with a "
            "damping ratio of 1; remove both (minreal)"
        ),
        "unstable": (
            "(folder)/model.mat: unstable, a pole at 47.75 Hz with a damping ratio of -1; a "
            "mirror is stable: identify it again"
        ),
        "an integrator": (
            "(folder)/model.mat: an integrator, a pole at 0 Hz; a mirror comes to rest: take "
            "drift off the records and identify again"
        ),
        "no conjugate": (
            "(folder)/model.mat: p has the complex root -5+3j without its conjugate; a "
            "mirror's response is real: give both"
        ),
        "falling": (
            "(folder)/model.mat: the output falls as the drive rises, the response at "
            "normalise_at (2 Hz) is -9.583e-08+4.016e-09j; a mirror file describes a mirror "
            "whose angle rises with its drive: turn the sign in the model, or normalise below "
            "the resonances if it is only their phase"
        ),
        "a zero at rest": (
            "(folder)/model.mat: a zero at 0 Hz: the mirror does not hold an angle; a mirror "
            "file has zeros above 0 Hz, so give the model with its answer to a constant drive"
        ),
        "no gain": "(folder)/model.mat: a gain of 0.0; the mirror does not move: check the model",
        "gains": "(folder)/model.mat: k has 3 gains; choose one input and one output",
        "a jump": (
            "(folder)/model.mat: 2 zeros over 1 pole, not strictly proper; a mirror does not "
            "follow a jump at once: add the pole that ends its band"
        ),
        "a matrix of roots": (
            "(folder)/model.mat: p has shape (2, 3), not a row or a column; choose one input and one output"
        ),
        "channels": ("(folder)/model.mat: 2 inputs and 3 outputs; a mirror file has one drive and one angle: choose"),
        "shapes": "(folder)/model.mat: D has shape (1, 2), where (1, 1) fits the others",
        "hidden": (
            "(folder)/model.mat: not minimal, it has a mode that no input drives: 3.183 Hz "
            "with a damping ratio of 1. Zeros, poles and coefficients would hide it; take the "
            "state space, or a minimal realisation of it (minreal)"
        ),
        "no time": (
            "(folder)/model.mat: sampled, Ts = -0.5 s, which is no time; give the sample time "
            "in s, or Ts = 0 if it is continuous"
        ),
        "the band": (
            "(folder)/model.mat: the band ends at 5000 Hz, and a model that is sampled at Ts = "
            "0.004 s says nothing beyond 125 Hz; give the band that it was identified in"
        ),
        "a whole sample": (
            "(folder)/model.mat: a pole at 0, a delay of a whole sample, which no continuous "
            "model of finite order has; take the delay off the model, and count it in "
            "fine_pointing.delay"
        ),
        "sampled unstable": (
            "(folder)/model.mat: unstable, a pole at |z| = 1.25 at 0 Hz; a mirror comes to rest: identify it again"
        ),
        "sampled integrator": (
            "(folder)/model.mat: an integrator, a pole at |z| = 1 at 0 Hz; a mirror comes to rest: identify it again"
        ),
        "sampled alike": (
            "(folder)/model.mat: two poles coincide, |z| = 0.25 at 0 Hz; set them apart, or reduce the model"
        ),
        "sampled sign": (
            "(folder)/model.mat: a pole on the negative real axis, |z| = 0.4 at 2.5e+04 Hz, "
            "turns its sign each sample, and no continuous mode does so alone; reduce the "
            "model, or identify it at a higher rate"
        ),
        "sampled jump": (
            "(folder)/model.mat: 2 zeros over 2 poles, its output follows the drive within a "
            "sample, and that of a mirror behind a hold does not (D = 0); read the output "
            "ahead of the drive"
        ),
        "sampled near": (
            "(folder)/model.mat: held and sampled at Ts = 2e-05 s again, no continuous model "
            "gives it within 1e-09: poles that nearly coincide at this rate; convert it where "
            "it was made (d2c in MATLAB), or sample it more slowly"
        ),
        "an input": (
            "(folder)/model.mat: its input is in rad, and a mirror's drive is in V; choose the one from drive to angle"
        ),
        "no denominator": "(folder)/model.mat: the denominator is zero; save one with a coefficient other than 0",
        "no numerator": "(folder)/model.mat: the numerator is zero, so the mirror does not move; check the model",
        "an order": "(folder)/model.mat: order 63, and a mirror has at most 60; reduce the model (balred)",
        "complex numbers": (
            "(folder)/model.mat: den holds complex numbers; a mirror's response to a real drive is real: save it real"
        ),
        "not finite": (
            "(folder)/model.mat: C holds a number that is not finite or beyond 1e+100; look for NaN or Inf in the model"
        ),
        "text": "(folder)/model.mat: C is not a matrix of numbers; save numbers",
        "sparse": "(folder)/model.mat: A is a sparse matrix; save it as full",
        "cells": "(folder)/model.mat: num has cells for 3 entries; choose one input and one output",
        "nothing": (
            "(folder)/model.mat has no linear system; it holds note, other, and none with A B "
            "C D, z p k or num den: save one of these forms"
        ),
        "structures": "(folder)/model.mat: variable 's' is an array of 3 structures; save one of them",
        "two systems": "(folder)/model.mat holds 2 systems, 's', 't'; choose one by its name",
        "bare and structure": (
            "(folder)/model.mat holds 2 systems, '', 's'; choose one by its name ('' has no structure)"
        ),
    }


def test_a_system_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    assert [
        message(tmp_path, {"s": roots(), "t": roots()}, variable="u"),
        message(tmp_path, {"s": 1.0, "t": "text"}, variable="s"),
        message(tmp_path, {"s": roots()}, variable=""),
        message(tmp_path, roots(), variable="none"),
    ] == [
        "(folder)/model.mat has no system 'u'; it has 's', 't'; choose one of these",
        (
            "(folder)/model.mat has no system 's'; it holds s, t, and none with A B C D, z p k "
            "or num den: save one of these forms"
        ),
        "(folder)/model.mat has no system ''; it has 's'; choose one of these",
        (
            "(folder)/model.mat has no system 'none'; it has one system, whose matrices are variables of their own: "
            "give no name of a variable"
        ),
    ]


def test_each_number_given_wrongly_is_refused_with_its_value(tmp_path):
    changes = [
        {"normalise_at_hz": 4e4},
        {"excited_from_hz": 700.0, "excited_to_hz": 90.0},
        {"output_unit": "deg"},
        {"rate_limit_v_s": math.inf},
        {"drive_max_v": math.nan},
        {"name": "\t"},
    ]
    fields = roots(poles=[-500.0, -200.0], zeros=[])
    assert [message(tmp_path, fields, replace(UNLIKE, **each)) for each in changes] == [
        (
            "(folder)/model.mat: the gain is taken at 40000 Hz (normalise_at), which is not in "
            "the band of 0.75 Hz to 400 Hz that the model was identified in; give a frequency "
            "inside it"
        ),
        "(folder)/model.mat: the band begins at 700 Hz and ends at 90 Hz; give its lower end first",
        "(folder)/model.mat: output_unit = 'deg' is none of rad, mrad, urad; give one of them",
        "(folder)/model.mat: rate_limit_v_s = inf is not finite; give a number",
        "(folder)/model.mat: drive_max_v = nan is not finite; give a number",
        ("(folder)/model.mat: the mirror has no name; give one, it stands in the mirror file and in the report"),
    ]


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (PermissionError(13, "Permission denied"), "cannot be read (Permission denied); check the path"),
        (OSError("no more"), "cannot be read (no more); check the path"),
        (matlab.MatlabFileError("it ends early"), "is no MATLAB file that can be read: it ends early. Save"),
    ],
)
def test_a_file_that_breaks_off_is_refused_with_what_broke(raised, said, tmp_path, monkeypatch):
    def broken(*args, **more):
        raise raised

    path = save(tmp_path, **roots())
    monkeypatch.setattr(matlab, "MatlabFile", broken)
    with pytest.raises(ExportError, match=re.escape(f"{path} {said}")) as error:
        import_mat(path, GIVEN)
    assert error.value.__cause__ is raised


def test_pairs_of_roots_find_their_own_conjugates_among_others():
    found = np.array([1 - 2j, -3.0, 1 + 2.5j, 1 + 2j, 4.0 + 1e-20j, 1 - 2.5j])
    made = roots_module.paired(found, "p", "a source")
    assert made.tolist() == [-3.0, 4.0, 1 + 2.5j, 1 - 2.5j, 1 + 2j, 1 - 2j]
    for lone, named in ((np.array([1 + 2j, 1 - 2j, 5 - 1j]), "5-1j"), (np.array([5 + 1j, 1 - 2j]), "5+1j")):
        with pytest.raises(ExportError, match=re.escape(f"z has the complex root {named} without its conjugate")):
            roots_module.paired(lone, "z", "a source")


def test_the_response_of_a_sampled_system_is_taken_on_the_circle():
    of = roots_module.Roots(np.array([0.5 + 0j]), np.array([0.25 + 0.5j, 0.25 - 0.5j]), 3.0, 0.125)
    freq = np.array([0.5, 1.5])
    z = np.exp(2j * np.pi * freq * 0.125)
    wanted = 3.0 * (z - 0.5) / (z**2 - 0.5 * z + 0.3125)
    np.testing.assert_allclose(roots_module.response(of, freq), wanted, rtol=1e-12)
    continuous = replace(of, period_s=0.0)
    s = 2j * np.pi * freq
    np.testing.assert_allclose(
        roots_module.response(continuous, freq), 3.0 * (s - 0.5) / (s**2 - 0.5 * s + 0.3125), rtol=1e-12
    )


def test_a_first_order_model_behind_a_hold_is_found_in_closed_form():
    sampled = roots_module.Roots(np.zeros(0), np.array([0.8 + 0j]), 0.5, 0.01)
    found = hold.without_hold(sampled, "a source")
    rate = -math.log(0.8) / 0.01
    assert (found.zeros.size, found.period_s) == (0, 0.0)
    assert (found.poles[0].real, found.gain) == (pytest.approx(-rate), pytest.approx(0.5 / 0.2 * rate))


@pytest.mark.parametrize(
    ("zeros", "poles", "gain", "residues"),
    [
        ([], [0.5], 3.0, [3.0]),
        ([0.25], [0.5, 0.75], 2.0, [2.0 * 0.25 / -0.25, 2.0 * 0.5 / 0.25]),
        ([], [0.5, 0.75, 0.25], 1.0, [1.0 / (-0.25 * 0.25), 1.0 / (0.25 * 0.5), 1.0 / (-0.25 * -0.5)]),
        ([0.5], [0.5 + 0.5j, 0.5 - 0.5j], 4.0, [4.0 * 0.5j / 1j, 4.0 * -0.5j / -1j]),
    ],
)
def test_residues_stand_in_the_order_of_their_poles(zeros, poles, gain, residues):
    of = roots_module.Roots(np.array(zeros, dtype=complex), np.array(poles, dtype=complex), gain, 0.5)
    np.testing.assert_allclose(hold._residues(of), residues, rtol=1e-12)


@pytest.mark.parametrize(("factor", "worst"), [(1.0, 0.0), (1.001, 1e-3), (0.5, 0.5)])
def test_a_model_behind_a_hold_differs_by_the_share_that_its_gain_is_off(factor, worst):
    sampled = roots_module.Roots(np.zeros(0, complex), np.array([0.8 + 0j]), 0.5, 0.01)
    rate = -math.log(0.8) / 0.01
    found = roots_module.Roots(np.zeros(0, complex), np.array([-rate + 0j]), factor * 0.5 / 0.2 * rate)
    assert hold._difference(found, sampled) == pytest.approx(worst, abs=1e-12)
    broken = roots_module.Roots(np.zeros(0, complex), np.array([0j]), 1.0)
    assert hold._difference(broken, sampled) == math.inf


@pytest.mark.parametrize(
    ("period", "said"),
    [(-0.5, "Ts = -0.5 s"), (math.inf, "Ts = inf s"), (math.nan, "Ts = nan s"), (-1.0, "Ts = -1 s")],
)
def test_a_sample_time_that_is_none_is_told(period, said):
    with pytest.raises(ExportError) as told:
        roots_module._period(period, "a source")
    assert str(told.value) == (
        f"a source: sampled, {said}, which is no time; give the sample time in s, or Ts = 0 if it is continuous"
    )
    assert [roots_module._period(each, "") for each in (0.0, 2e-5)] == [0.0, 2e-5]


@pytest.mark.parametrize(
    ("shape", "taken"), [((1, 3), True), ((3, 1), True), ((1, 1), True), ((0, 3), True), ((2, 2), False)]
)
def test_roots_stand_in_a_row_or_a_column(shape, taken):
    values = np.arange(float(np.prod(shape))).reshape(shape)
    if taken:
        assert roots_module._row(values, "z", "a source").tolist() == values.ravel().tolist()
        return
    with pytest.raises(
        ExportError, match=re.escape(f"a source: z has shape {shape}, not a row or a column; choose one")
    ):
        roots_module._row(values, "z", "a source")


def test_an_object_without_a_name_is_called_python_control():
    system = python_control.tf([1.0], [1.0, -5.0])
    with pytest.raises(
        ExportError, match=r"^python-control: unstable, a pole at 0.7958 Hz with a damping ratio of -1; a"
    ):
        import_control(system, GIVEN)
    text = import_control(python_control.tf([2.0], [1.0, 500.0]), GIVEN)
    assert text.splitlines()[:2] == [
        "# Mirror imported from python-control: linear, without hysteresis or creep.",
        'name = "Our mirror"',
    ]
    sampled = import_control(python_control.tf([0.5], [1.0, -0.5], 1e-4), GIVEN)
    assert sampled.splitlines()[1] == "#   sampled there, Ts = 0.0001 s; its drive counts as held over each sample"


@pytest.mark.parametrize(
    ("pole", "refused"),
    [
        (complex(-1e-3, 1e-7), False),
        (complex(-1e-3, 5e-10), True),
        (complex(-0.5, 4e-7), True),
        (complex(-0.5, 6e-7), False),
    ],
)
def test_a_pole_is_on_the_negative_axis_by_the_share_of_its_size(pole, refused):
    of = roots_module.Roots(np.zeros(0, complex), np.array([pole, pole.conjugate()]), 1.0, 0.01)
    if not refused:
        hold._refuse_without_inverse(of, "a source")
        return
    with pytest.raises(
        ExportError, match=r"^a source: a pole on the negative real axis, \|z\| = .* at 50 Hz, turns its sign"
    ):
        hold._refuse_without_inverse(of, "a source")


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"s": states(C="text"), "x": 1.0}, "(folder)/model.mat, s: C is not a matrix of numbers; save numbers"),
        (
            {"tip": roots(k=0.0)},
            "(folder)/model.mat, tip: a gain of 0.0; the mirror does not move: check the model",
        ),
        ({"tip": roots(k=np.ones((2, 1)))}, "(folder)/model.mat, tip: k has 2 gains; choose one input and one output"),
        (
            {"a": states(InputUnit="Hz")},
            "(folder)/model.mat, a: its input is in Hz, and a mirror's drive is in V; choose",
        ),
    ],
)
def test_a_refusal_of_a_structure_has_its_name_behind_the_file(tmp_path, fields, told):
    assert message(tmp_path, fields).startswith(told)


def test_an_object_and_a_file_of_version_7_3_are_told_what_to_save(tmp_path, monkeypatch):
    path = tmp_path / "model.mat"
    for begin in (b"MATLAB 7.3 MAT-file", b"\x89HDF\r\n\x1a\n and more"):
        path.write_bytes(begin)
        with pytest.raises(ExportError) as told:
            matlab.load(path)
        assert str(told.value) == (
            f"{path} is of version 7.3; save it as version 7: s = struct('A', sys.A, 'B', sys.B, 'C', sys.C, 'D', "
            "sys.D, 'Ts', sys.Ts); save('model.mat', 's', '-v7')"
        )
    monkeypatch.setattr(matlab, "load", lambda of: {"tip": matlab.Unread("an object of MATLAB", "save it")})
    with pytest.raises(ExportError) as told:
        matlab.select(path, None)
    assert str(told.value) == (
        f"{path}: variable 'tip' is an object of MATLAB, which only MATLAB can read; save its matrices: "
        "s = struct('A', tip.A, 'B', tip.B, 'C', tip.C, 'D', tip.D, 'Ts', tip.Ts)"
    )


@pytest.mark.parametrize(
    ("names", "form"),
    [("ABCD", "ABCD"), ("zpkABC", "zpk"), ("zpkABCD", "ABCD"), ("ABC", ""), ("zp", ""), ("", "")],
)
def test_the_first_form_that_is_whole_counts(names, form):
    assert "".join(matlab.form_of(dict.fromkeys(names))) == form
    assert matlab.form_of({"num": 1, "den": 2, "z": 3}) == ("num", "den")


@pytest.mark.parametrize(
    ("stated", "taken"),
    [
        ("V", True),
        ("", True),
        ("rad", False),
        (np.array("V"), True),
        (np.array(["m"]), False),
        (np.array(["m", "V"]), True),
        (3.0, True),
    ],
)
def test_an_input_is_in_volts_where_its_unit_is_one_word(stated, taken):
    fields = {"z": np.zeros((0, 1)), "p": np.array([[-2.0]]), "k": np.array([[3.0]]), "InputUnit": stated}
    if taken:
        found = roots_module.roots_of_fields(fields, "a source")
        assert (found.poles.tolist(), found.gain, found.period_s) == ([-2.0], 3.0, 0.0)
        return
    with pytest.raises(
        ExportError, match=r"^a source: its input is in (rad|m), and a mirror's drive is in V; choose the"
    ):
        roots_module.roots_of_fields(fields, "a source")


@pytest.mark.parametrize(
    ("zeros", "poles", "why"),
    [
        ([], [-300.0, -2e-10], r"an integrator, a pole at 3\.18e-11 Hz; a mirror comes to rest"),
        ([], [-300.0, -4e-10], ""),
        ([], [-1e-3, -1.001e-3, -3e6], ""),
        ([], [-3e6, -1e-3, -1e-3 * (1.0 + 5e-10)], r"two poles coincide at 0\.0001592 Hz"),
        ([-1.001e-3], [-3e6, -1e-3, -1e-1], ""),
        ([-3e6, -1e-1 * (1.0 + 5e-9)], [-1e-3, -2e6, -1e-1], r"a zero cancels the pole at 0\.01592 Hz"),
        ([2.0, 0.0], [-1.0, -2.0, -3.0], "a zero at 0 Hz"),
        ([], [-1.0, complex(0.0, 5.0), complex(0.0, -5.0)], r"unstable, a pole at 0\.7958 Hz"),
    ],
)
def test_roots_are_apart_by_a_share_of_their_own_size_and_at_rest_by_one_of_the_largest(zeros, poles, why):
    of = roots_module.Roots(np.array(zeros, dtype=complex), np.array(poles, dtype=complex), 2.0)
    if not why:
        assert roots_module.checked(of, "a source") is of
        return
    with pytest.raises(ExportError, match=f"^a source: (not minimal, )?{why}"):
        roots_module.checked(of, "a source")


def test_roots_of_one_size_stand_by_their_damping_the_largest_first():
    found = np.array([complex(-300, 400), complex(-300, -400), -500.0, complex(-480, 140), complex(-480, -140), 500.0])
    for order in ([0, 1, 2, 3, 4, 5], [5, 4, 3, 2, 1, 0]):
        frequencies, dampings = mirror_file._roots("zero", found[order], "a source")
        assert frequencies.count("79.577") == 4 and frequencies.endswith("] # a source")
        numbers = re.search(r"= \[(.*)\]", dampings)[1].split(", ")
        assert [float(each) for each in numbers] == pytest.approx([1.0, 0.96, 0.6, -1.0])


def test_what_is_no_system_may_lie_beside_one(tmp_path):
    """A sparse matrix, text and an array of structures of another kind: none of them is asked for."""
    others = np.array([(1, 2), (3, 4)], dtype=[("time", "O"), ("angle", "O")])
    path = save(tmp_path, grid=csc_array(np.eye(3)), note="text", records=others, tip=SHAPES["roots"])
    assert difference(answer(tmp_path, import_mat(path, GIVEN), BAND), by_roots(BAND)) < NINE_DIGITS
    assert "imported from model.mat, tip:" in import_mat(path, GIVEN, "tip")


def test_of_many_variables_without_a_system_the_first_twenty_are_told(tmp_path):
    names = [f"v{n}" for n in range(23)]
    told = message(tmp_path, dict.fromkeys(names, 1.0))
    assert told == (
        f"(folder)/model.mat has no linear system; it holds {', '.join(names[:20])}, and none with A B C D, z p k or "
        "num den: save one of these forms"
    )


@pytest.mark.parametrize(
    "error", [ZeroDivisionError("division by zero"), OverflowError("too large"), ValueError("odd")]
)
def test_numbers_that_cannot_be_worked_with_are_told_with_the_reason(tmp_path, monkeypatch, error):
    def broken(*given):
        raise error

    monkeypatch.setattr(mirror_file, "roots_of_fields", broken)
    assert message(tmp_path, {"tip": SHAPES["roots"]}) == (
        f"(folder)/model.mat, tip: its numbers cannot be worked with ({error}); look for sizes that no mirror has, or "
        "save zeros, poles and gain"
    )


def test_a_name_with_characters_that_toml_has_not_is_written_so_that_it_reads_back(tmp_path):
    name = 'a\x7fb\\c "d" \u00b5\x1f'
    text = import_mat(save(tmp_path, **SHAPES["roots"]), replace(GIVEN, name=name))
    assert "\x7f" not in text and "\x1f" not in text and "\u00b5" in text
    assert tomllib.loads(text)["name"] == name


def test_a_refusal_of_an_object_has_the_name_that_was_said_of_it():
    two = python_control.ss(-np.eye(2), np.eye(2), np.ones((1, 2)), 0)
    with pytest.raises(
        ExportError, match=r"^our rig: 2 inputs and 1 output; a mirror file has one drive and one angle"
    ):
        import_control(two, GIVEN, "our rig")
    with pytest.raises(ExportError, match=r"^our rig: unstable, a pole at"):
        import_control(python_control.tf([1.0], [1.0, -5.0]), GIVEN, "our rig")
    with pytest.raises(ExportError, match=r"^our rig: a float; give a control\.StateSpace or a control\.TransferF"):
        import_control(2.0, GIVEN, "our rig")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    "key",
    ["travel_rad", "rate_limit_v_s", "bias_v", "drive_min_v", "drive_max_v", "excited_from_hz", "excited_to_hz",
     "normalise_at_hz"],
)  # fmt: skip
def test_each_number_that_is_given_beside_a_model_is_finite(tmp_path, key, value):
    path = save(tmp_path, **roots())
    with pytest.raises(ExportError) as refused:
        import_mat(path, replace(GIVEN, **{key: value}))
    assert str(refused.value).endswith(f"model.mat: {key} = {value} is not finite; give a number")


@pytest.mark.parametrize("at_hz", [1.0, 5000.0])
def test_a_gain_may_be_taken_at_either_end_of_the_band(tmp_path, at_hz):
    assert import_mat(save(tmp_path, **roots()), replace(GIVEN, normalise_at_hz=at_hz)).startswith("# Mirror imported")


@pytest.mark.parametrize(
    ("key", "shape", "wanted"),
    [("A", (3, 2), (3, 3)), ("B", (2, 1), (3, 1)), ("B", (4, 1), (3, 1)), ("C", (1, 2), (1, 3)), ("C", (1, 4), (1, 3)),
     ("D", (1, 2), (1, 1)), ("D", (2, 1), (1, 1))],
)  # fmt: skip
def test_each_matrix_that_is_too_small_or_too_large_is_named(tmp_path, key, shape, wanted):
    path = save(tmp_path, **states(**{key: np.ones(shape)}))
    with pytest.raises(ExportError) as refused:
        import_mat(path, GIVEN)
    assert f"model.mat: {key} has shape {shape}, where {wanted} fits the others" in str(refused.value)


def test_what_a_mirror_file_is_refused_for_is_told_key_by_key_and_once_for_all_of_it():
    one = PydanticCustomError("value_error", "Value error, poles lie together")
    found = ValidationError.from_exception_data(
        "Mirror",
        [
            {"type": one, "loc": ("linear", "poles", 2), "input": 1},
            {"type": "missing", "loc": ("travel",), "input": {}},
            {"type": PydanticCustomError("value_error", "a gain, Value error, or none"), "loc": (), "input": 1},
        ],
    )
    assert mirror_file._reasons(found) == (
        "linear.poles.2: poles lie together; travel: Field required; a gain, Value error, or none"
    )
    assert mirror_file._reasons(ValueError("Value error, as it is")) == "Value error, as it is"


@pytest.mark.parametrize(("ends_hz", "period_s", "beyond"), [
    (125.0, 0.004, ""), (125.5, 0.004, "125"), (0.5, 1.0, ""), (0.75, 1.0, "0.5"), (400.0, 2e-5, ""),
])  # fmt: skip
def test_a_band_may_end_at_half_the_rate_and_not_beyond(ends_hz, period_s, beyond):
    given = replace(GIVEN, excited_from_hz=0.25, normalise_at_hz=0.25, excited_to_hz=ends_hz)
    if not beyond:
        mirror_file._check_band(given, period_s, "a source")
        return
    with pytest.raises(ExportError) as told:
        mirror_file._check_band(given, period_s, "a source")
    assert str(told.value) == (
        f"a source: the band ends at {ends_hz:g} Hz, and a model that is sampled at Ts = {period_s:g} s says nothing "
        f"beyond {beyond} Hz; give the band that it was identified in"
    )


@pytest.mark.parametrize(
    ("there", "size", "why"),
    [
        (complex(3.0, -4.0), 5.0, ""),
        (complex(0.0, 2.0), 2.0, ""),
        (complex(0.0, -1e-300), 1e-300, ""),
        (complex(-1e-9, 5.0), 0.0, "the output falls as the drive rises, the response at normalise_at (8 Hz) is -1"),
        (0j, 0.0, "the model's response at normalise_at (8 Hz) is 0j, which cannot be divided out"),
        (complex(math.inf, 0.0), 0.0, "the model's response at normalise_at (8 Hz) is (inf+0j), which cannot"),
        (complex(math.nan, 1.0), 0.0, "the model's response at normalise_at (8 Hz) is (nan+1j), which cannot"),
    ],
)  # fmt: skip
def test_a_gain_is_the_size_of_what_rises_with_the_drive(monkeypatch, there, size, why):
    asked = []
    monkeypatch.setattr(
        mirror_file, "response", lambda model, freq: (asked.append((model, freq.tolist())), np.array([there]))[1]
    )
    given = replace(GIVEN, normalise_at_hz=8.0)
    if why:
        with pytest.raises(ExportError) as told:
            mirror_file._gain("model", given, "a source")
        assert str(told.value).startswith(f"a source: {why}")
    else:
        assert mirror_file._gain("model", given, "a source") == pytest.approx(size)
    assert asked == [("model", [8.0])]


@pytest.mark.parametrize(("dt", "period_s"), [(0, 0.0), (1, 1.0), (1.0, 1.0), (0.25, 0.25), (None, None), (True, None)])
def test_an_object_is_sampled_at_its_period_be_it_one_second(dt, period_s):
    for system in (python_control.tf([0.5], [1.0, -0.5], dt), python_control.ss(0.5, 1.0, 0.5, 0.0, dt)):
        if period_s is not None:
            found = roots_module.roots_of_control(system, "a source")
            assert (found.period_s, found.poles.tolist(), found.gain) == (period_s, [0.5], 0.5)
            continue
        with pytest.raises(ExportError) as told:
            roots_module.roots_of_control(system, "a source")
        assert str(told.value) == (
            f"{system.name} has dt = {dt}: continuous, or sampled how fast? Give it dt = 0 or its period in s"
        )


@pytest.mark.parametrize("shape", [(0, 0), (1, 2), (2, 1)])
def test_a_sample_time_is_one_number(shape):
    fields = {"z": np.zeros((0, 1)), "p": np.array([[-2.0]]), "k": np.array([[3.0]]), "Ts": np.full(shape, 0.5)}
    with pytest.raises(ExportError, match=r"^a source: sampled, Ts = nan s, which is no time; give the sample time"):
        roots_module.roots_of_fields(fields, "a source")


def test_as_many_states_and_powers_as_a_mirror_may_have_are_taken(monkeypatch):
    monkeypatch.setattr(roots_module, "MOST_ORDER", 2)
    ones = np.ones((2, 1))
    two = lti.StateSpace(np.diag([-1.0, -2.0]), ones, ones.T, np.zeros((1, 1)))
    found = roots_module.roots_of_states(two, 0.0, "a source")
    assert (found.zeros.tolist(), sorted(found.poles.real.tolist()), found.gain) == ([-1.5], [-2.0, -1.0], 2.0)
    powers = roots_module.roots_of_coefficients(np.array([0.0, 6.0]), np.array([0.0, 3.0, 9.0, 6.0]), "a source")
    assert (powers.zeros.size, sorted(powers.poles.real.tolist()), powers.gain) == (0, [-2.0, -1.0], 2.0)
    three = lti.StateSpace(np.diag([-1.0, -2.0, -3.0]), np.ones((3, 1)), np.ones((1, 3)), np.zeros((1, 1)))
    for call, said in (
        (lambda: roots_module.roots_of_states(three, 0.0, "a source"), "3 states"),
        (lambda: roots_module.roots_of_coefficients(np.ones(1), np.ones(4), "a source"), "order 3"),
    ):
        with pytest.raises(ExportError) as told:
            call()
        assert str(told.value) == f"a source: {said}, and a mirror has at most 2; reduce the model (balred)"
