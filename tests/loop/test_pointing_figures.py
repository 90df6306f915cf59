"""Figures that docs/pointing.md records of loops that no mission has: what benchmarks print stands there."""

import math
import re
import runpy
import shutil
from dataclasses import replace
from types import SimpleNamespace

import pytest

import benchmarks_page
from design_plants import axis_plant
from hysteretic_springs import AMPLITUDE_RAD, FAMILIES, on_springs, quiet, sines, with_errors
from microrad.loop import control, coupled_study
from places import ROOT, benchmark
from several_axes import scene_of

PAGE = (ROOT / "docs" / "pointing.md").read_text(encoding="utf-8")


def row(first, after=""):
    """The cells of the first row of a table of the page, from a line with a text on, that begins so."""
    lines = PAGE[PAGE.rindex("\n", 0, PAGE.index(after)) :] if after else PAGE
    line = next(x for x in lines.splitlines() if x.startswith(f"| {first} |"))
    return [cell.strip() for cell in line.strip("|").split("|")][1:]


# --------------------------------------------------------------------------------------------- controllers by plant
PLANTS = {
    "plain, as shipped but for the mirror's linear part": {},
    "resonance at 300 Hz, damping 0.02": {"resonance": (300.0, 0.02)},
    "resonance at 900 Hz, damping 0.02": {"resonance": (900.0, 0.02)},
    "wheel lines of 2 and 1 µrad rms at 80 and 160 Hz": {"lines": ((80.0, 2e-6), (160.0, 1e-6))},
}
FREE = control.Weights(1e-6, 1.0, 0.0, 0.0)
OF_COLUMNS = (
    control.PI,
    control.PI_NOTCH,
    control.RESONANT_DAMPING,
    control.DISTURBANCE_OBSERVER,
    control.LQG,
    control.peak_family((80.0, 160.0)),
)


@pytest.mark.promise("pointing-95")
@pytest.mark.parametrize("name", PLANTS)
def test_the_optimum_of_each_plant_is_the_page_s(name):
    plant = axis_plant(**PLANTS[name])
    free = control.lqg_controller(plant, FREE)
    assert f"{1e6 * math.sqrt(sum(control.by_source(plant, free).values())):.3f}" == row(name)[0]


@pytest.mark.promise("pointing-95")
@pytest.mark.parametrize(
    ("name", "column"),
    [
        pytest.param(name, column, marks=[pytest.mark.endurance] if column or name != next(iter(PLANTS)) else [])
        for name in PLANTS
        for column in range(6)
    ],
)
def test_what_a_tuned_controller_leaves_on_each_plant_is_the_page_s(name, column):
    if printed := row(name)[1 + column]:
        tuned = control.tune(OF_COLUMNS[column], [axis_plant(**PLANTS[name])], control.Specification(0.5), seed=1)
        assert 1e6 * tuned.residual_rms_rad == pytest.approx(float(printed), abs=1.1e-3)
        assert tuned.margins.modulus >= 0.5
    else:
        assert column == 5 and "lines" not in PLANTS[name]


# ------------------------------------------------------------------------------------------------------- feedforward
FIRST = {"Bouc-Wen": "Bouc-Wen, as modelled", "plays": "plays and a polynomial, as modelled"}
ERRORS = {
    "": {},
    "gain of the mirror -20 %": {"gain": 0.8},
    "gain -5 %": {"gain": 0.95},
    "width of its loops +30 %": {"width": 1.3},
    "resonances +5 % / -5 %": {"resonance": 1.05},
}


FORWARD = 2
"""Its column; that of the drive under which the model follows best is the last one."""


@pytest.mark.promise("pointing-87", "pointing-89", "pointing-90", "pointing-91")
@pytest.mark.endurance
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.promise("pointing-100")
@pytest.mark.promise("pointing-101")
def test_ways_to_follow_a_reference_leave_what_the_page_says(family):
    """Radial rms in µrad, and in brackets that of the reference alone; a tenth of a µrad, or 2 %."""
    bench = runpy.run_path(str(ROOT / "benchmarks" / "feedforward.py"))
    scene = scene_of(on_springs(FAMILIES[family]))
    (x, _) = scene.loop.references
    given = sines(x.point_ahead_rad, x.line_of_sight_rate_rad_s, AMPLITUDE_RAD)
    linear = tuple(replace(each, references=given) for each in scene.linear)
    scene = replace(scene, loop=replace(scene.loop, references=given), linear=linear)
    (pi,) = coupled_study.design(scene, only=("PI",)).made
    ways, leaves = bench["ways"](scene, pi.controller), {}
    for words, errors in ERRORS.items():
        printed = row(words or FIRST[family], FIRST[family])
        real = replace(scene.loop, mirror=with_errors(scene.loop.mirror, **errors))
        for cell, way in zip(printed, ways.values(), strict=True):
            found = bench["left"](real, way, bench["RUNS"]), bench["left"](quiet(real), way, 1)
            wanted = [float(each) for each in re.findall(r"[0-9.]+", cell)]
            assert found == pytest.approx(wanted, rel=0.02, abs=0.1), (words, cell)
            leaves[words, len(leaves) % 5] = found
    for words, percent in (("gain of the mirror -20 %", 20.0), ("gain -5 %", 5.0)):
        assert 1.5 <= leaves[words, FORWARD][1] / percent <= 1.95
    assert leaves["width of its loops +30 %", FORWARD][1] == pytest.approx(4.0, abs=0.4)
    assert 0.1 < leaves["", FORWARD][0] - leaves["", FORWARD + 2][0] < 0.25
    still = replace(scene.loop, references=sines(amplitude_rad=0.0))
    both = re.search(r"Without a reference the PI leaves ([0-9.]+) and ([0-9.]+) µrad", PAGE)
    wanted = float(both[1 + list(FAMILIES).index(family)])
    assert bench["left"](still, ways["feedback"], bench["RUNS"]) == pytest.approx(wanted, rel=0.02)


# --------------------------------------------------------------------------------------------- what benchmarks print
@pytest.mark.promise("pointing-102")
def test_the_benchmark_of_controllers_prints_the_columns_of_the_page(monkeypatch, capsys):
    bench, tuned = benchmark("controllers"), []
    assert list(bench.PLANTS.values()) == list(PLANTS.values())
    made = SimpleNamespace(residual_rms_rad=1e-6, margins=SimpleNamespace(modulus=0.5))
    monkeypatch.setattr(bench.control, "tune", lambda family, *rest, **how: tuned.append(family.name) or made)
    bench.main()
    names = [family.name for family in OF_COLUMNS]
    assert tuned == [*names[:-1] * 3, *names]
    printed = re.findall(r": optimum ([0-9.]+)", capsys.readouterr().out)
    assert printed == [row(name)[0] for name in PLANTS]


@pytest.mark.promise("pointing-103")
def test_what_a_step_of_several_axes_costs_is_that_of_the_last_release():
    rows = {each["what"]: each["value"] for each in benchmarks_page.releases()[-1]["rows"]}
    side, alone = (
        [rows[f"{size}: {way} over C twin, a plant step"] for size in ("6 states, 3 springs", "36 states, 12 springs")]
        for way in ("64 side by side", "one run")
    )
    assert side[1] < side[0] < 0.5 and 1.0 < alone[1] < alone[0]


@pytest.mark.promise("pointing-104")
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_benchmark_of_the_adaptive_inverse_times_the_exported_code_beside_the_frozen_one(capsys):
    runpy.run_path(str(ROOT / "benchmarks" / "adaptive_inverse.py"))["step_cost"]()
    words = r"a step of exported C, two axes: frozen (\d+) ns, adaptive (\d+) ns; ratio ([\d.]+)\n"
    frozen, adaptive, ratio = map(float, re.fullmatch(words, capsys.readouterr().out).groups())
    assert ratio == pytest.approx(adaptive / frozen, rel=0.02)
