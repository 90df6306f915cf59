"""Flight code of a feedforward that runs the mirror's hysteresis: against the kernel, its bound, its cost, refusals."""

import shutil
import subprocess
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

import several_axes
from export.test_export_flight import EXACT, NO_CONVERTER, Code, Counters, bench, difference, held, spoiled
from export.test_export_operations import counted, counted_fixed, needs_gxx, swinging, whole, wild
from hysteretic_springs import BOUC_WEN, PLAYS, on_springs, sines
from microrad.core import lti
from microrad.export import choice
from microrad.export.flight import c_code, double_run, fixed, operations
from microrad.export.flight.rounding import errors_before_converter, rounding_bound
from microrad.export.flight.write import export_flight
from microrad.export.linear_part.sections import sections
from microrad.export.records import Signal, Vectors
from microrad.loop.pointing_loop.kernel_arrays import forward_arrays
from microrad.loop.pointing_loop.loop import ForwardHysteresis
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii
from waiting import HANG_S

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")

GENERAL = BoucWen(0.2, -1e-5, -0.25, 2e-5, 0.1, -0.025, 1500.0, 6.0, 0.02, -0.01)
POWERED = replace(BOUC_WEN, exponent=2.0)
WIDENING = PrandtlIshlinskii((0.0, 0.5, 4.0), (0.1, 0.05, -0.03), widening_s=1e-4, rate_limit_v_s=1500.0)
BANKS = {
    "Bouc-Wen": ((BOUC_WEN, BOUC_WEN), ()),
    "plays and a polynomial": ((), (PLAYS, PLAYS)),
    "all that there is": ((GENERAL, BOUC_WEN), (WIDENING, PLAYS, PrandtlIshlinskii((1.0, 3.0), (0.2, 0.1)))),
    "exponent 2": ((POWERED,), ()),
    "a polynomial alone": ((), (PrandtlIshlinskii((), (), polynomial_rad=(0.3, 2.0, -1.0), reach_v=5.0),)),
}
REPEATED = {"plays and a polynomial", "exponent 2"}
"""What the other banks hold, too, or one element of theirs with another power."""
each_bank = pytest.mark.parametrize(
    "bank", [pytest.param(bank, marks=[pytest.mark.endurance] if bank in REPEATED else []) for bank in BANKS]
)


@cache
def base():
    """A controller of two axes on springs of plays that follow sines."""
    made = choice.choose_coupled(several_axes.mission(NO_CONVERTER), on_springs(PLAYS), "PI + feedforward")
    loop = replace(made.scene.loop, references=sines(71e-6, 2.55e-6))
    return replace(made, scene=replace(made.scene, loop=loop))


@cache
def chosen(bank):
    """The same with another bank in its feedforward, whose elements are driven by mixtures of both."""
    if bank == "plays and a polynomial":
        return base()
    bouc_wen, plays = BANKS[bank]
    elements, m, s = len(bouc_wen) + len(plays), 2, base().controller.system
    rng = np.random.Generator(np.random.Philox(elements))
    mixing = rng.uniform(-1.0, 1.0, (elements, 2))
    C, D = (np.vstack([each[:m], mixing @ each[m:]]) for each in (s.C, s.D))
    forward = ForwardHysteresis(bouc_wen, plays, rng.uniform(-1.0, 1.0, (m, elements)))
    system = lti.StateSpace(s.A, s.B, C, D)
    return replace(base(), controller=replace(base().controller, system=system, forward=forward))


@cache
def flown(bank, samples=700):
    of = choice.flight_controller(chosen(bank))
    return of, choice.vectors(chosen(bank), samples)


# ---------------------------------------------------------------------------------------------------- the same numbers
@pytest.mark.promise("export-16")
@each_bank
def test_double_precision_is_the_kernel(bank, tmp_path):
    of, vectors = flown(bank)
    assert [each.name for each in of.inputs] == ["optical_error_rad", "reference_rad"]
    off, counters = difference(Code(tmp_path, of), vectors)
    print(f"{bank}: off by {off:.2g} of the largest command of {np.abs(vectors.commands).max():.3g} V")
    assert 0.0 < off < (c_code.POWER_BOUND_SHARE if bank == "exponent 2" else EXACT)
    assert counters == Counters(vectors.saturated, vectors.rate_clamped, 0, 0)
    assert (vectors.rate_clamped > 0) == (bank == "all that there is")
    assert np.abs(vectors.commands).max() > 5.0


@pytest.mark.promise("export-16")
@pytest.mark.parametrize("samples", [pytest.param(n, marks=pytest.mark.endurance) for n in (20_000, 100_000)])
def test_it_is_the_kernel_over_many_samples(samples, tmp_path):
    of, vectors = flown("plays and a polynomial", samples)
    off, counters = difference(Code(tmp_path, of), vectors)
    print(f"off by {off:.2g} of the largest command")
    assert vectors.inputs.shape == (samples, 4)
    assert 0.0 < off < EXACT
    assert counters == Counters(0, 0, 0, 0)


@each_bank
def test_the_run_in_double_is_the_kernels(bank):
    of, vectors = flown(bank)
    run = double_run.run_in_double(of, sections(of), vectors.inputs)
    commands = np.clip(run.free, of.minimum_v, of.maximum_v)
    assert_allclose(commands, vectors.commands, rtol=0, atol=1e-9 * np.abs(vectors.commands).max())


@pytest.mark.promise("export-16")
@each_bank
def test_single_precision_stays_within_its_bound(bank, tmp_path):
    of, vectors = flown(bank)
    form = sections(of)
    bound = rounding_bound(of, form, vectors)
    code = Code(tmp_path, of, "single", bound=bound)
    off, _ = difference(code, vectors)
    found = off * np.max(np.abs(vectors.commands))
    print(f"{bank}: {found:.3g} V, bound {bound.command_v:.3g} V")
    assert 1e-8 < found <= bound.command_v < 1e-3
    ahead = errors_before_converter(of, form, vectors)
    assert np.all(np.abs(code.replay(vectors.inputs) - vectors.commands) <= ahead + 1e-5)


@each_bank
def test_the_bound_holds_for_hysteresis_alone(bank, tmp_path):
    """No states and no feedback: a swing of 10 V through the elements, whose rounding is all that there is."""
    bouc_wen, plays = BANKS[bank]
    elements = len(bouc_wen) + len(plays)
    forward = forward_arrays(ForwardHysteresis(bouc_wen, plays, np.ones((1, elements))), 1, 2e-4)
    empty = np.zeros((0, 0))
    D = np.vstack([[0.0], *[[5e4 * (1.0 + 0.1 * e)] for e in range(elements)]])
    system = lti.StateSpace(empty, np.zeros((0, 1)), np.zeros((1 + elements, 0)), D)
    of = replace(
        flown("Bouc-Wen")[0],
        inputs=(Signal("reference_rad", 1, "rad", "reference", 0.1),),
        actuators=1,
        system=system,
        anti_windup=np.zeros((0, 1)),
        minimum_v=-np.inf,
        maximum_v=np.inf,
        forward=forward,
    )
    time_s = 2e-4 * np.arange(1500)
    inputs = 2e-4 * (np.sin(2 * np.pi * 15.0 * time_s) + 0.2 * np.sin(2 * np.pi * 170.0 * time_s))[:, None]
    form, v = sections(of), Vectors(inputs, np.zeros((1500, 1)), 0, 0)
    wrong = np.abs(Code(tmp_path, of, "single").replay(inputs) - double_run.run_in_double(of, form, inputs).free)
    ahead = errors_before_converter(of, form, v)
    print(f"{bank}: {wrong.max():.3g} V, bound {ahead.max():.3g} V")
    assert np.all(wrong <= ahead)
    assert 0.0 < np.max(ahead) <= 60.0 * np.max(wrong)


def test_garbage_does_not_take_it_beyond_its_limits(tmp_path):
    of, vectors = flown("all that there is")
    code = Code(tmp_path, of, "single")
    bad = spoiled(vectors.inputs, code.number)
    good, rejected = held(bad)
    found, counters = code.run(bad)
    assert np.all(np.isfinite(found))
    assert np.max(np.abs(found)) <= of.maximum_v
    assert rejected == counters.rejected > 0
    assert np.array_equal(found, code.run(good)[0])
    given = replace(vectors, inputs=bad.astype(float), commands=found.astype(float))
    status, numbers, words = bench(code, given, "sanitized", passes=0)
    assert (status, words) == (0, "")
    assert numbers["rejected"] == rejected


# ------------------------------------------------------------------------------------------------------------ its cost
@needs_gxx
@pytest.mark.parametrize("bank", ["Bouc-Wen", "all that there is"])
def test_it_costs_what_is_stated(bank, tmp_path):
    of, vectors = flown(bank)
    code, stated = counted(tmp_path, of, "double"), operations.operations(of, sections(of), "double")
    most = code.most(vectors.inputs, swinging(of), wild(of))
    assert replace(most, comparisons=0) == replace(stated, comparisons=0)
    assert 0.9 * stated.comparisons < most.comparisons <= stated.comparisons


# ---------------------------------------------------------------------------------------------------- what is written
@pytest.mark.promise("export-4")
def test_it_is_written_with_its_report(tmp_path):
    found = export_flight(base(), tmp_path / "out", samples=500)
    assert found.bench.faults == 0
    header = (tmp_path / "out" / "pi_feedforward.h").read_text(encoding="utf-8")
    text = " ".join(header.replace("\n *", " ").split())
    assert "Feedforward: 2 hysteresis element(s) of the mirror with 8 play(s), run forward on the motion" in text
    assert "The feedforward keeps track of the mirror's hysteresis only as long as each command is applied." in text
    assert "#define PI_FEEDFORWARD_FORWARD_PLAYS 8U" in header
    assert (tmp_path / "out" / "pi_feedforward_hysteresis.h").exists()


# -------------------------------------------------------------------------------------------------------- fixed point
@pytest.mark.promise("export-14", "export-16")
def test_in_fixed_point_it_stays_within_its_report(tmp_path):
    """The linear part in whole numbers, hysteresis in single precision."""
    of, vectors = flown("all that there is")
    form = sections(of)
    made = fixed.quantised(of, form, vectors)
    r = made.report
    assert 0.0 < r.inverse_v < 5e-4
    assert [o.name for o in r.outputs[2:4]] == ["drive of hysteresis 0", "drive of hysteresis 1"]
    for file, text in fixed.fixed_code(of, form, made, "flown").items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    (tmp_path / "vectors.csv").write_text(c_code.vectors_text(of, vectors), encoding="utf-8")
    words = ["make", "-s", "-C", tmp_path, "check", "CC=gcc", "PASSES=0"]
    done = subprocess.run(words, check=True, capture_output=True, text=True, timeout=HANG_S)
    numbers = {line.split()[0]: float(line.split()[1]) for line in done.stdout.splitlines()}
    print(f"{numbers['largest_difference_v']:.3g} V, bound {r.bound_v:.3g} V")
    assert 0.0 < numbers["largest_difference_v"] <= r.bound_v < 1e-4
    assert numbers["rate_clamped"] == vectors.rate_clamped
    assert numbers["overflowed"] == numbers["faults"] == 0
    assert "The feedforward, in single precision, adds up to" in fixed.quantisation_text(made)


@needs_gxx
def test_in_fixed_point_it_costs_what_is_stated(tmp_path):
    of, vectors = flown("plays and a polynomial")
    made = fixed.quantised(of, sections(of), vectors)
    stated = operations.fixed_operations(of, made)
    runs = [whole(made, each) for each in (vectors.inputs, swinging(of), wild(of))]
    most = counted_fixed(tmp_path, of, made).most_fixed(*runs)
    assert replace(most, single=replace(most.single, comparisons=stated.single.comparisons)) == stated
    assert 0.9 * stated.single.comparisons < most.single.comparisons <= stated.single.comparisons
