"""Flight code of an inverse that learns: the kernel's commands, and limits that nothing takes it beyond."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import designs
from export.test_export_flight import (  # noqa: F401
    EXACT,
    Code,
    bench,
    difference,
    garbage_stays_within_limits,
    held,
    pytestmark,
    spoiled,
)
from learning_loops import CREEP, PLAYS, in_series, loop_of, softened
from microrad.core import kernels
from microrad.export import choice
from microrad.export.flight import c_code
from microrad.export.flight.operations import operations
from microrad.export.linear_part.sections import sections
from microrad.export.records import ExportError
from microrad.loop.control import adaptive
from microrad.loop.pointing_loop.loop import with_adaptation

SAMPLES = 10_000


@cache
def learning(resolution_v=0.0, learns=True, samples=SAMPLES):
    """The controller of two axes as it flies, and its run on a mirror that has softened and creeps."""
    nominal = loop_of(axes=2)
    nominal = replace(nominal, drive=replace(nominal.drive, drive_resolution_v=resolution_v))
    made = in_series(nominal)
    made = with_adaptation(made, nominal) if learns else made
    softer = replace(nominal, mirror=loop_of(softened(PLAYS), CREEP, axes=2).mirror)
    scene = replace(designs.chosen("PI + inverse in series").scene, loop=softer)
    chosen = replace(designs.chosen("PI + inverse in series"), scene=scene, controller=made)
    return choice.flight_controller(chosen), choice.vectors(chosen, samples)


def test_it_is_the_kernel_while_it_learns(tmp_path):
    of, vectors = learning()
    assert [each.name for each in of.inputs] == ["optical_error_rad", "gauge_rad", "reference_rad"]
    code = Code(tmp_path, of)
    off, counters = difference(code, vectors)
    print(f"off by {off:.2g} of the largest command")
    assert 0.0 < off < EXACT
    assert (counters.rejected, counters.faults) == (0, 0)
    frozen = replace(of, adaptation=replace(of.adaptation, settings=no_learning(of.adaptation.settings)))
    assert difference(Code(tmp_path / "frozen", frozen), vectors)[0] > 1e-3  # it learnt


@pytest.mark.endurance
def test_it_is_the_kernel_over_1e5_samples(tmp_path):
    of, vectors = learning(samples=100_000)
    assert 0.0 < difference(Code(tmp_path, of), vectors)[0] < EXACT


def test_it_is_the_kernel_where_a_weight_is_held_at_its_least(tmp_path, monkeypatch):
    monkeypatch.setattr(adaptive, "LEAST_WEIGHT", 0.9)
    of, vectors = learning.__wrapped__()
    assert difference(Code(tmp_path, of), vectors)[0] < EXACT
    lower = of.adaptation.settings.copy()
    lower[:, kernels.LEAST_WEIGHT] = 0.0
    other = replace(of, adaptation=replace(of.adaptation, settings=lower))
    assert difference(Code(tmp_path / "lower", other), vectors)[0] > 1e-4


def no_learning(settings):
    still = settings.copy()
    still[:, kernels.GAIN] = still[:, kernels.SHARE] = 0.0
    return still


def test_garbage_does_not_take_it_beyond_its_limits_nor_what_it_learns(tmp_path):
    of, vectors = learning(0.35e-3)
    vectors = replace(vectors, inputs=vectors.inputs[:2500], commands=vectors.commands[:2500])
    code = Code(tmp_path, of)
    bad = garbage_stays_within_limits(code, of, vectors)
    state = code.begin()
    code.replay(bad, state)
    assert len(np.unique(code.replay(vectors.inputs[:500], state)[:, 0])) > 50  # it moves again


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e11])
def test_whatever_an_upset_leaves_in_what_it_learns_commands_stay_within_the_limits(number, tmp_path):
    of, vectors = learning()
    code, rng = Code(tmp_path, of), np.random.default_rng(7)
    for _ in range(60):
        state = code.begin()
        code.replay(vectors.inputs[:200], state)
        numbers = np.frombuffer(state, dtype=float, count=len(state) // 8)
        numbers[rng.integers(0, len(numbers))] = number
        found = code.replay(vectors.inputs[200:600], state)
        assert np.all(np.isfinite(found))
        assert np.max(np.abs(found)) <= of.maximum_v
        assert np.ptp(found[-100:, 0]) > 0.0


def test_the_operations_are_those_of_the_worst_phase_of_a_cycle():
    (of, _), (frozen, _) = learning(), learning(learns=False)
    found, without = (operations(each, sections(each), "double") for each in (of, frozen))
    one = replace(of, adaptation=replace(of.adaptation, settings=with_cycle(of.adaptation.settings, 8)))
    assert operations(one, sections(one), "double") == found  # a longer pause costs nothing
    assert found.divisions == without.divisions + 2  # an actuator judges while the other one learns
    assert found.multiplications > without.multiplications + 10 * 4


def with_cycle(settings, samples):
    found = settings.copy()
    found[:, kernels.CYCLE] = samples
    return found


@pytest.mark.parametrize("precision", ["single", "fixed"])
def test_another_precision_than_double_is_refused(precision):
    of, _ = learning()
    with pytest.raises(ExportError, match=f"stated in {precision} precision: export it in double precision"):
        c_code.refuse_learning(of, precision)
    c_code.refuse_learning(learning(learns=False)[0], precision)


def test_the_header_says_what_learns():
    of, _ = learning()
    files = c_code.flight_code(of, sections(of), "flown", "double")
    assert "10 play operator(s) that learn" in files["flown.h"]
    assert "uint32_t fallbacks;" in files["flown.h"]
