"""Co-simulation units: FMPy accepts them, and they do what the kernels do, also where there is no microrad."""

import importlib.metadata
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import zipfile
from dataclasses import replace
from functools import cache
from itertools import chain
from pathlib import Path
from types import SimpleNamespace

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from packaging.requirements import Requirement

import designs
import several_axes
import slaves
from export.test_export_adaptive import chosen_to_learn
from loops import IDEAL_DRIVE
from microrad.core import kernels, lti
from microrad.export import choice
from microrad.export.flight.build import compiler
from microrad.export.fmi import description, fmu
from microrad.export.fmi.description import plant_of, variables
from microrad.export.records import ExportError, Origin, PlantUnit, Signal
from microrad.loop import control
from microrad.loop import sine_run as simulate
from microrad.loop.pointing_loop import kernel_arrays
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.mirror import hysteresis
from microrad.mirror import model as mirror
from scenes import scene_of
from slaves import Slave

VERSIONS = ("2.0", "3.0")
AGAIN = {version: pytest.param(version, marks=pytest.mark.endurance) for version in VERSIONS}
"""A version whose way has been gone by another unit, and that would be compiled for one test."""

AGREEMENT = 1e-9
"""Largest difference from the kernel, as a share of the peak."""

pytestmark = pytest.mark.skipif(compiler() is None, reason="there is no C compiler")


# --------------------------------------------------------------------------------------------------- units, and a slave
def tracking():
    return designs.chosen("PID + inverse")


def pointing(name="PI + inverse"):
    return designs.chosen(name)


def coupled():
    return designs.of_three_actuators()


OPTICS = np.array([[1.0, 0.2], [-0.1, 0.9], [0.5, 0.5]])


def everything():
    """A mirror with all that a plant may have: feedback through hysteresis, direct paths, a full matrix, both families
    of hysteresis, an exponent other than 1 and thresholds that widen; two actuators and two outputs."""
    elements = (
        hysteresis.BoucWen(9e-5, -3e-7, -4.8e-5, 4.7e-4, 38.4, 34.6, 400.0, 6.0),
        hysteresis.BoucWen(8e-5, 0.0, -2e-5, 0.0, 2.4, 0.6, np.inf, 5.0, gamma_1_v=0.1, eta_1_v=-0.2, exponent=1.7),
    )
    plays = (
        hysteresis.PrandtlIshlinskii((0.0, 0.3, 0.9), (5e-5, 2e-5, 1e-5), widening_s=2e-4, rate_limit_v_s=300.0),
        hysteresis.PrandtlIshlinskii((0.0, 0.5), (4e-5, 1e-5)),
    )
    rng = np.random.default_rng(5)
    A = np.array([[-900.0, 3000.0, 50.0], [-3000.0, -900.0, 20.0], [10.0, 5.0, -40.0]])
    F = np.zeros((4, 3))
    F[0, 0], F[3, 1] = 40.0, -30.0
    return mirror.Mirror(
        "all there is",
        A=A,
        B=rng.normal(size=(3, 2)) * 1e-2,
        E=rng.normal(size=(3, 4)) * 800.0,
        F=F,
        G=np.array([[1.0, 0.0], [0.0, 1.0], [0.7, 0.2], [0.0, 0.9]]),
        C=rng.normal(size=(2, 3)),
        D=rng.normal(size=(2, 2)) * 1e-5,
        K=rng.normal(size=(2, 4)),
        bouc_wen=elements,
        plays=plays,
        inverse=(),
    )


def rich_unit():
    step = 2e-5
    plant = mirror.discretise(everything(), step)
    follow = control.amplifier_factor(replace(IDEAL_DRIVE, bandwidth_hz=2000.0), step)
    origin = Origin('a <mission> & "more"', "0" * 64, "all\x07 there */ is")
    return PlantUnit(origin, plant, OPTICS, 2000.0, follow, 0.02, 6.0)


def play_mirror():
    """A mirror without states: hysteresis alone."""
    return mirror.assemble("static", "static", None, hysteresis.PrandtlIshlinskii((0.0, 0.4), (5e-5, 2e-5)))


def play_unit():
    plant = mirror.discretise(play_mirror(), 1e-5)
    return PlantUnit(Origin("m", "0" * 64, "static"), plant, np.eye(1), np.inf, 1.0, np.inf, 0.0)


BENT = hysteresis.PrandtlIshlinskii((0.0, 0.4), (0.05, 0.02), polynomial_rad=(0.004, -0.01, 0.02), reach_v=1.5)
"""Plays with a polynomial that ends within the walk of the tests."""


def spring():
    """A plate on three actuators with hysteresis in its stiffness, that of one with a polynomial beside its plays."""
    made = several_axes.three_actuators()
    return replace(made, mirror=replace(made.mirror, plays=(BENT, *made.mirror.plays[1:])))


def test_a_plant_of_another_loop_is_refused():
    with pytest.raises(ExportError, match="has no loop 'tracking': one of fine_pointing, control that is a table of"):
        choice.plant_unit(designs.mission(), "tracking")


UNITS = {
    "mirror": lambda: choice.plant_unit(designs.mission(), "control"),
    "rich": rich_unit,
    "plays": play_unit,
    "loop": lambda: choice.loop_unit(tracking()),
    "pointing": lambda: choice.loop_unit(pointing()),
    "spring": lambda: choice.plant_unit(several_axes.mission(), "fine_pointing", spring()),
    "coupled": lambda: choice.loop_unit(coupled()),
}


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """The file of a unit, written once."""
    folder = tmp_path_factory.mktemp("units")

    @cache
    def written(name, version):
        path = folder / f"{name}_{version[0]}.fmu"
        made = fmu.write_unit(UNITS[name](), path, version, name)
        assert made.platform is not None
        assert made.words == f"{path}: FMI {version}, sources and a library for {made.platform}"
        return path

    return written


@pytest.fixture
def slave(archive, tmp_path):
    """Makes instances and frees them in the end."""
    made = []

    def instance(name, version, **options):
        made.append(Slave(archive(name, version), tmp_path, **options))
        return made[-1]

    yield instance
    for each in made:
        each.unit.freeInstance()


def assert_follows(found, wanted, agreement=AGREEMENT):
    peak = np.max(np.abs(wanted))
    assert peak > 0.0
    assert np.max(np.abs(np.asarray(found) - wanted)) <= agreement * peak


# ------------------------------------------------------------------------------------------------------------- contents
CHECKED = [("rich", "3.0"), ("loop", "2.0"), ("spring", "3.0")]
CHECKED += [
    pytest.param(name, "3.0" if version == "2.0" else "2.0", marks=pytest.mark.endurance) for name, version in CHECKED
]
CHECKED += [
    pytest.param(name, version, marks=pytest.mark.endurance) for name in ("mirror", "pointing") for version in VERSIONS
]
"""All that a mirror may have, a loop, and a mirror of several axes; the rest is made of the same parts."""


@pytest.mark.promise("readme-13")
@pytest.mark.promise("export-1", "export-28")
@pytest.mark.parametrize(("name", "version"), CHECKED)
@pytest.mark.promise("readme-25")
def test_fmpy_finds_no_fault(archive, name, version):
    path = archive(name, version)
    assert validate_fmu(str(path)) == []
    description = fmpy.read_model_description(path, validate=True)
    assert description.fmiVersion == version
    assert description.coSimulation.canGetAndSetFMUstate and description.coSimulation.canSerializeFMUstate
    listed = variables(UNITS[name](), version)
    assert [v.name for v in description.modelVariables] == [v.name for v in listed]
    origin = plant_of(UNITS[name]()).origin
    assert f"Mission: {origin.mission}, sha256 {origin.mission_sha256}." in description.description
    if name == "rich":
        assert description.modelName == "all there */ is"
    else:
        assert origin.mirror and description.modelName.startswith(origin.mirror)
    units = {v.name.removesuffix("[1]"): v.unit for v in description.modelVariables}
    output = "m" if name == "spring" else "rad"
    assert units[f"mirror_{output}"] == output and units["amplifier_slew_v_s"] == "V/s" and units["drive_v"] == "V"


@pytest.mark.promise("export-28")
def test_vectors_are_arrays_in_3_0_and_their_elements_variables_in_2_0(archive):
    two, three = (fmpy.read_model_description(archive("rich", version)) for version in VERSIONS)
    shapes = {v.name: v.shape for v in three.modelVariables}
    assert shapes["command_v"] == (2,) and shapes["line_of_sight_rad"] == (3,) and shapes["mirror_rad"] == (2,)
    assert shapes["prandtl_ishlinskii[1].threshold_v"] == (3,) and shapes["bouc_wen[1].d1_rad_v"] == ()
    by_element = [
        name if not shape else f"{name}[{i + 1}]" for name, shape in shapes.items() for i in range(*shape or (1,))
    ]
    assert [v.name for v in two.modelVariables] == by_element
    starts = [
        (float(start) for start in v.start.split()) if v.start is not None else (None,) * int(np.prod(v.shape))
        for v in three.modelVariables
    ]
    assert [None if v.start is None else float(v.start) for v in two.modelVariables] == [*chain(*starts)]


def test_numbers_of_several_arrays_come_in_their_order(slave):
    one = slave("rich", "3.0")
    one.unit.setFloat64(one.references("command_v"), [1.0, -2.0])
    wanted = [*one.get("prandtl_ishlinskii[1].threshold_v"), *one.get("bias_v"), *one.get("command_v")]
    of = [*one.references("prandtl_ishlinskii[1].threshold_v"), *one.references("bias_v"), *one.references("command_v")]
    assert one.unit.getFloat64(of, 6) == wanted == [0.0, 0.3, 0.9, 6.0, 1.0, -2.0]


def test_another_number_of_values_is_refused_and_changes_nothing(slave):
    one = slave("rich", "3.0")
    one.set("command_v", [1.0, -2.0])
    for call, said in (
        (lambda: one.set("command_v", [5.0]), "fmi3SetFloat64: 1 values for variables that hold 2"),
        (lambda: one.unit.getFloat64(one.references("mirror_rad"), 3), "fmi3GetFloat64: 3 values for variables that"),
        (lambda: one.unit.getInt32(one.references("faults"), 2), "fmi3GetInt32: 2 values for variables that hold 1"),
        (lambda: one.unit.getFloat64(one.references("faults")), "there is no such variable"),
    ):
        with pytest.raises(FMICallException):
            call()
        assert said in one.said[-1]
    np.testing.assert_array_equal(one.get("command_v"), [1.0, -2.0])


def test_fmpy_notices_a_fault(archive, tmp_path):
    """The check can fail: a description with an output too many is refused."""
    fmpy.extract(archive("mirror", "2.0"), tmp_path)
    path = tmp_path / "modelDescription.xml"
    path.write_text(path.read_text().replace('<Unknown index="3"', '<Unknown index="5"', 1))
    assert any("Outputs" in problem for problem in validate_fmu(str(tmp_path)))


@pytest.mark.promise("export-30")
@pytest.mark.parametrize("version", VERSIONS)
def test_the_start_values_are_those_of_the_design(archive, version):
    description = fmpy.read_model_description(archive("rich", version))
    given = {v.name: [float(each) for each in v.start.split()] for v in description.modelVariables if v.start}
    start = {
        name if len(numbers) == 1 else f"{name}[{i + 1}]": x
        for name, numbers in given.items()
        for i, x in enumerate(numbers)
    }
    model = everything().bouc_wen[1]
    assert start["bouc_wen[2].exponent"] == model.exponent
    assert start["bouc_wen[1].alpha_1_v"] == 38.4
    assert start["bouc_wen[2].rate_limit_v_s"] == sys.float_info.max  # none
    assert start["prandtl_ishlinskii[1].threshold_v[3]"] == 0.9
    assert start["prandtl_ishlinskii[1].widening_s"] == 2e-4
    assert start["amplifier_bandwidth_hz"] == 2000.0
    assert start["amplifier_slew_v_s"] == pytest.approx(1000.0, rel=1e-14)
    assert start["bias_v"] == 6.0
    assert start["plant_step_s"] == 2e-5


@pytest.mark.promise("export-30")
def test_bias_limits_steps_and_delays_are_constants_that_can_be_read(slave):
    unit, one = choice.loop_unit(tracking()), slave("loop", "3.0")
    wanted = {
        "bias_v": unit.plant.bias_v,
        "plant_step_s": unit.plant.plant.step_s,
        "control_period_s": unit.controller.period_s,
        "computation_delay_s": unit.delay_steps * unit.plant.plant.step_s,
        "command_minimum_v": unit.controller.minimum_v,
        "command_maximum_v": unit.controller.maximum_v,
    }
    constants = [v.name for v in one.description.modelVariables if v.variability == "constant"]
    assert {name: one.get(name)[0] for name in constants} == wanted
    assert wanted["computation_delay_s"] > 0.0 and wanted["command_minimum_v"] < 0.0 < wanted["command_maximum_v"]
    for name in constants:
        with pytest.raises(FMICallException):
            one.set(name, [1.0])
        assert one.said[-1].endswith("cannot be set")


@pytest.mark.promise("export-30")
def test_sensor_noise_is_not_inside(slave):
    """A loop at rest stays there until as much comes in as the mission's optical sensor has of noise."""
    noise_rad = scene_of(designs.mission()).loop.optical.noise_rad
    one, period_s = slave("pointing", "2.0"), choice.loop_unit(pointing()).controller.period_s

    def moved(disturbance_rad):
        found = []
        for _ in range(50):
            one.set("disturbance_rad", [disturbance_rad, disturbance_rad])
            one.step(period_s)
            found.append([one.get(name) for name in ("line_of_sight_rad", "command_v", "drive_v")])
        return np.any(np.array(found) != 0.0)

    assert not moved(0.0)
    assert moved(noise_rad)


@pytest.mark.promise("export-28")
@pytest.mark.parametrize("version", VERSIONS)
def test_it_holds_its_sources_and_licence(archive, version):
    with zipfile.ZipFile(archive("loop", version)) as opened:
        names = opened.namelist()
        assert names[0] == "modelDescription.xml"
        licence = opened.read("documentation/licenses/license.txt").decode()
        assert {info.date_time for info in opened.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    assert "BSD 3-Clause License" in licence and "2-Clause" in licence
    kinds = ("plant.c", "loop.c", "ctl.c", "unit.c", "plant_hysteresis.h", "ctl_hysteresis.h")
    assert {f"sources/loop_{kind}" for kind in kinds} <= set(names)
    assert f"sources/fmi{version[0]}.c" in names
    assert ("sources/buildDescription.xml" in names) == (version == "3.0")
    assert not [each for each in names if "bench" in each or "Makefile" in each]


@pytest.mark.promise("export-29")
@pytest.mark.parametrize("version", VERSIONS)
def test_the_error_of_a_loop_depends_at_once_on_reference_and_disturbance_and_its_command_on_nothing(archive, version):
    description = fmpy.read_model_description(archive("loop", version))
    at_once = {each.variable.name.partition("[")[0]: each.dependencies or [] for each in description.outputs}
    named = {key: {v.name.partition("[")[0] for v in found} for key, found in at_once.items()}
    assert named["error_rad"] == {"reference_rad", "disturbance_rad"} and not named["command_v"]


def test_the_build_description_names_the_sources(archive):
    description = fmpy.read_model_description(archive("loop", "3.0"), validate=True)
    found = description.buildConfigurations[0].sourceFileSets[0]
    assert found.language == "C99"
    with zipfile.ZipFile(archive("loop", "3.0")) as opened:
        wanted = {Path(each).name for each in opened.namelist() if each.endswith(".c")}
    assert set(found.sourceFiles) == wanted


@pytest.mark.skipif(shutil.which("nm") is None, reason="there is no nm")
@pytest.mark.parametrize("version", VERSIONS)
def test_the_library_shows_the_functions_of_the_standard_alone(archive, tmp_path, version):
    fmpy.extract(archive("loop", version), tmp_path)
    (library,) = (tmp_path / "binaries").glob("*/*")
    listed = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True).stdout
    shown = {line.split()[-1] for line in listed.splitlines()} - {"_init", "_fini"}
    key = f"fmi{version[0]}"
    header = (tmp_path / "sources" / f"{key}Functions.h").read_text()
    declared = {line.split()[-1].rstrip(";") for line in header.splitlines() if "TYPE " in line and "_Export" in line}
    model_exchange = {each for each in declared if version == "2.0" and each not in shown}
    assert shown <= declared and len(shown) > 20
    assert model_exchange <= {
        *("fmi2EnterEventMode", "fmi2NewDiscreteStates", "fmi2EnterContinuousTimeMode", "fmi2CompletedIntegratorStep"),
        *("fmi2SetTime", "fmi2SetContinuousStates", "fmi2GetDerivatives", "fmi2GetEventIndicators"),
        *("fmi2GetContinuousStates", "fmi2GetNominalsOfContinuousStates"),
    }
    if version == "3.0":
        assert shown == declared


def test_the_same_unit_is_the_same_file(tmp_path):
    unit = UNITS["plays"]()
    other = replace(unit, bias_v=unit.bias_v + 1.0)
    made = [fmu.write_unit(each, tmp_path / f"{i}.fmu", "2.0", "mirror") for i, each in enumerate((unit, unit, other))]
    assert made[0].path.read_bytes() == made[1].path.read_bytes()
    assert made[0].guid == made[1].guid != made[2].guid
    assert made[0].path.read_bytes() != made[2].path.read_bytes()
    assert sorted(each.name for each in tmp_path.iterdir()) == ["0.fmu", "1.fmu", "2.fmu"]


# ------------------------------------------------------------------------------------------ the scenario of the paper
def sine(freq_hz):
    c, scenario = tracking(), designs.mission().mission.scenario
    reference, steady = simulate.sine(scenario.amplitude_rad, freq_hz, c.setup.timing.period_s)
    return simulate.track(c.name, c.mirror, c.setup, c.inverse, reference, steady)


@pytest.mark.promise("export-29")
@pytest.mark.parametrize(
    ("version", "freq_hz"), [("2.0", 25.0), pytest.param("3.0", 15.0, marks=pytest.mark.endurance)]
)
def test_the_mirror_follows_the_kernel_over_figure_8(slave, version, freq_hz):
    """Driven by the recorded commands of PID and inverse, each with the computation delay."""
    trace, timing = sine(freq_hz), tracking().setup.timing
    one = slave("mirror", version)
    commands = trace.command_v.ravel()
    places = {each: one.references(each) for each in ("command_v", "line_of_sight_rad", "drive_v")}
    late, rest = divmod(timing.delay_steps, timing.steps_per_sample)
    found = np.zeros((commands.size, 2))
    for k in range(commands.size):
        found[k] = *one.get("line_of_sight_rad"), *one.get("drive_v")
        for behind, steps in ((late + 1, rest), (late, timing.steps_per_sample - rest)):
            if steps:
                one.set("command_v", [commands[k - behind] if k >= behind else 0.0])
                one.step(steps * timing.step_s)
    assert all(len(each) == 1 for each in places.values())
    assert_follows(found[:, 0], trace.output_rad[:, 0])
    assert_follows(found[:, 1], trace.drive_v[:, 0])
    assert one.count("rate_clamped") == trace.counts.clamped
    assert one.count("slew_limited") == trace.counts.slew_limited
    one.unit.terminate()


@pytest.mark.promise("export-29")
@pytest.mark.parametrize(("version", "freq_hz"), [("3.0", 25.0), ("2.0", 15.0)])
def test_the_closed_loop_follows_the_kernel_over_figure_8(slave, version, freq_hz):
    trace, timing = sine(freq_hz), tracking().setup.timing
    one = slave("loop", version)
    samples = trace.time_s.size
    found, errors, commands = np.zeros(samples), np.zeros(samples), np.zeros(samples)
    for k in range(samples):
        one.set("reference_rad", trace.reference_rad[k])
        found[k], errors[k] = one.get("line_of_sight_rad")[0], one.get("error_rad")[0]
        one.step(timing.period_s)
        commands[k] = one.get("command_v")[0]
    assert_follows(found, trace.output_rad[:, 0])
    assert_follows(errors, trace.error_rad[:, 0])
    assert_follows(commands, trace.command_v[:, 0])
    assert one.count("rate_clamped") == trace.counts.clamped
    assert one.count("slew_limited") == trace.counts.slew_limited
    assert one.count("saturated") == trace.counts.saturated
    assert one.count("inverse_rate_clamped") == trace.counts.inverse_clamped
    assert one.count("rejected") == one.count("faults") == one.count("controller_faults") == one.count("lost") == 0
    assert one.get("time")[0] == pytest.approx(samples * timing.period_s)


@pytest.mark.promise("export-28")
@pytest.mark.parametrize("version", VERSIONS)
def test_fmpys_own_simulation_runs_the_loop(archive, version):
    """The high-level call that users make, with a reference as an array over time."""
    trace, timing = sine(25.0), tracking().setup.timing
    samples = 400
    name, shape = ("reference_rad[1]", ()) if version == "2.0" else ("reference_rad", (1,))
    signal = np.zeros(trace.time_s.size, dtype=[("time", float), (name, float, shape)])
    signal["time"], signal[name] = trace.time_s, trace.reference_rad[:, 0].reshape(-1, *shape)
    result = fmpy.simulate_fmu(
        archive("loop", version),
        stop_time=samples * timing.period_s,
        output_interval=timing.period_s,
        input=signal[: samples + 1],
        output=[name.replace("reference", "line_of_sight")],
    )
    assert result.size == samples + 1
    assert_follows(result[name.replace("reference", "line_of_sight")].ravel(), trace.output_rad[: samples + 1, 0])


# ---------------------------------------------------------------------------------------------- the fine-pointing loop
def quiet(of, **optical):
    """A choice with sensors that have no noise, and its optical sensor otherwise changed."""
    loop = of.scene.loop
    gauge = loop.gauge and replace(loop.gauge, noise_rad=0.0)
    changed = replace(loop, optical=replace(loop.optical, noise_rad=0.0, **optical), gauge=gauge)
    return replace(of, scene=replace(of.scene, loop=changed))


def outside(loop, p, state, by_sample):
    """Reference and disturbance at each plant step, (steps + 1, axes), of run 0: what the kernel does not show."""
    steps = (len(by_sample) - 1) * p.steps_per_sample
    blocks = -(-steps // 4)
    gauss = []
    for purpose in p.purpose:
        numbers = np.zeros(4 * blocks * kernels.LANES)
        kernels.gaussian_kernel(p.seed, state.first_run, purpose, 0, numbers)
        gauss.append(numbers.reshape(-1, kernels.LANES)[:steps, 0])
    gauss = np.array(gauss).T
    n = p.shaping_diagonal.size
    A = np.diag(p.shaping_diagonal)
    A[np.arange(n), np.arange(n) ^ 1] = p.shaping_coupling
    shaping = state.shaping.reshape(-1, kernels.LANES)[:n, 0].copy()
    disturbance = np.zeros((steps + 1, loop.axes))
    disturbance[0] = p.shaping_output @ shaping
    for k in range(steps):
        shaping = A @ shaping + p.shaping_noise @ gauss[k]
        disturbance[k + 1] = p.shaping_output @ shaping
    at = np.arange(len(by_sample)) * p.steps_per_sample
    reference = np.stack([np.interp(np.arange(steps + 1), at, column) for column in by_sample.T], axis=1)
    return reference, disturbance


LEARNS = "an inverse that learns"
POINTING = {
    "PI + inverse": {},
    "LQG of all axes": {},
    LEARNS: {},
    "resonant damping": {"delay_steps": 7, "every": 2, "resolution_rad": 2e-8, "field_of_view_rad": 1.5e-4},
}


@pytest.mark.promise("export-18", "export-21")
@pytest.mark.parametrize(
    ("name", "version"),
    [
        pytest.param("PI + inverse", "2.0", marks=pytest.mark.endurance),
        ("resonant damping", "3.0"),
        ("LQG of all axes", "3.0"),
        (LEARNS, "3.0"),
        pytest.param(LEARNS, "2.0", marks=pytest.mark.endurance),
    ],
)
def test_the_loop_follows_the_kernel_in_the_jitter(tmp_path, name, version):
    """Fine pointing, plant step by plant step; also with a late, coarse optical sensor that loses the spot."""
    made = coupled() if name == "LQG of all axes" else chosen_to_learn() if name == LEARNS else pointing(name)
    chosen = quiet(made, **POINTING[name])
    loop, samples = chosen.scene.loop, 2000 if name == LEARNS else 400
    p = kernel_arrays.arrays(loop, chosen.controller, 11)
    state = kernel_arrays.start(loop, p, 0)
    by_sample = kernel_arrays.reference(loop, 0, samples)
    by_sample[300:360] += 3e-4  # further than the narrow field of view
    reference, disturbance = outside(loop, p, state, by_sample[:, :, 0])
    axes, m, outputs = loop.axes, loop.mirror.actuators, loop.mirror.axes
    trace = np.empty((samples, axes + kernels.DRIVE_FIELDS * m + outputs + p.B.shape[1], kernels.LANES))
    residual = np.empty((samples, axes, kernels.LANES))
    kernels.ensemble_loop(p, state, by_sample, residual, trace, kernels.UNSHIFTED)
    as_rounded = 2.0 ** (1 - lti.EXACT_BITS)  # the kernel begins with rounded states
    assert_follows(disturbance[: -1 : p.steps_per_sample], trace[:, :axes, 0], as_rounded)

    path = tmp_path / "jitter.fmu"
    fmu.write_unit(choice.loop_unit(chosen), path, version, "jitter")
    one = Slave(path, tmp_path)
    shown = ("error_rad", "drive_v", f"mirror_{choice.loop_unit(chosen).plant.output_unit}")
    errors, drives, mirrors = np.zeros((samples, axes)), np.zeros((samples, m)), np.zeros((samples, outputs))
    for k in range(samples):
        for j in range(p.steps_per_sample):
            one.set("reference_rad", reference[k * p.steps_per_sample + j])
            one.set("disturbance_rad", disturbance[k * p.steps_per_sample + j])
            if j == 0:
                errors[k], drives[k], mirrors[k] = (one.get(each) for each in shown)
            one.step(p.step_s)
    # The kernel's plant is rounded, which the plate's lightest resonance, of damping 20 in 2100, raises by its quality.
    agreement = 2100.0 / (2.0 * 20.0) * as_rounded if name == "LQG of all axes" else AGREEMENT
    assert_follows(errors, residual[:, :, 0], agreement)
    at = axes + kernels.DRIVE_FIELDS * m
    assert_follows(drives, trace[:, axes + kernels.DRIVE_NOW : at : kernels.DRIVE_FIELDS, 0], agreement)
    assert_follows(mirrors, trace[:, at : at + outputs, 0], agreement)
    counts = state.counts.reshape(-1, kernels.LANES)[:, 0]
    assert one.count("lost") == counts[kernels.COUNT_LOST]
    assert (
        0 < counts[kernels.COUNT_LOST] < 100
        if "field_of_view_rad" in POINTING[name]
        else counts[kernels.COUNT_LOST] == 0
    )
    assert one.count("saturated") == counts[kernels.COUNT_SATURATED]
    assert one.count("rate_clamped") == counts[kernels.COUNT_CLAMPED]
    assert one.count("slew_limited") == counts[kernels.COUNT_SLEW]
    if name == LEARNS:
        assert one.count("fallbacks") == counts[kernels.COUNT_FALLBACK]
        in_use = state.track.reshape(-1, kernels.TRACK_FIELDS, kernels.LANES)[:m, kernels.IN_USE, 0]
        assert np.all(in_use == 1.0)  # it has learnt, and commands by it
    one.unit.terminate()


@pytest.mark.promise("export-29")
@pytest.mark.parametrize("version", [AGAIN["2.0"], "3.0"])
def test_a_long_communication_step_holds_its_inputs(slave, version):
    unit = UNITS["pointing"]()
    short, long = slave("pointing", version), slave("pointing", version)
    for one, parts in ((short, unit.steps_per_sample), (long, 1)):
        for k in range(40):
            one.set("disturbance_rad", [1e-5 * np.sin(k), 2e-5])
            for _ in range(parts):
                one.step(unit.controller.period_s / parts)
    assert np.max(np.abs(long.get("command_v"))) > 1e-3
    np.testing.assert_array_equal(short.get("command_v"), long.get("command_v"))
    np.testing.assert_array_equal(short.get("mirror_rad"), long.get("mirror_rad"))


# ------------------------------------------------------------------------------------------------ every kind of a plant
class Nothing:
    """A reference that stands still: the commands come in by its way below."""

    def at(self, time_s):
        return np.zeros(time_s.shape)


def by_kernel(of, optics, drive, commands, steps, step_s):
    """The kernel's mirror under commands that are held over so many plant steps: outputs and drives behind each, and
    the counters. Commands come in as a reference that the controller gives out as it is."""
    (samples, m), axes = commands.shape, optics.shape[0]
    timing = control.Timing(steps * step_s, steps, 0)
    optical = replace(pointing().scene.loop.optical, noise_rad=0.0, delay_steps=0, every=1)
    nothing = (Nothing(),) * axes
    loop = PointingLoop(of, optics, drive, timing, ((),) * axes, optical, None, nothing)
    inputs = axes + of.axes + axes
    through = np.zeros((m, inputs))
    through[:, axes + of.axes : axes + of.axes + m] = np.eye(m)
    system = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((m, 0)), through)
    p = kernel_arrays.arrays(loop, LoopController("through", system, np.zeros((0, m))), 0)
    state = kernel_arrays.start(loop, p, 0)
    reference = np.zeros((samples + 2, axes, 1))
    reference[:samples, :m, 0] = commands
    trace = np.empty((samples + 1, axes + kernels.DRIVE_FIELDS * m + of.axes + inputs, kernels.LANES))
    kernels.ensemble_loop(p, state, reference, np.empty((0, 0, 0)), trace, kernels.UNSHIFTED)
    at = axes + kernels.DRIVE_FIELDS * m
    drives = trace[1:, axes + kernels.DRIVE_NOW : at : kernels.DRIVE_FIELDS, 0]
    return trace[1:, at : at + of.axes, 0], drives, state.counts.reshape(-1, kernels.LANES)[:, 0]


def rich_by_kernel(commands, steps=1, of=None, bandwidth_hz=2000.0):
    drive = replace(IDEAL_DRIVE, bandwidth_hz=bandwidth_hz, slew_v_s=1000.0)
    return by_kernel(of or everything(), OPTICS, drive, commands, steps, 2e-5)


def walk(actuators, samples=400):
    return 3.0 * np.sin(np.cumsum(np.random.default_rng(3).normal(size=(samples, actuators)) * 0.2, axis=0))


def driven(one, commands, duration, outputs="mirror_rad"):
    found = []
    for command in commands:
        one.set("command_v", command)
        one.step(duration)
        found.append(one.get(outputs))
    return np.array(found)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_plant_with_all_there_is_follows_the_kernel(slave, version):
    """Feedback, direct paths, a full matrix, both families of hysteresis with all their parameters."""
    unit = rich_unit()
    assert unit.plant.feedback and unit.plant.direct and unit.plant.rest.value.size
    one, commands = slave("rich", version), walk(2)
    found = driven(one, commands, 3 * unit.plant.step_s)
    output, drives, counts = rich_by_kernel(commands, 3)
    assert_follows(found, output)
    assert_follows(one.get("drive_v"), drives[-1])
    assert_follows(one.get("line_of_sight_rad"), OPTICS @ output[-1])
    driven(one, np.zeros((1, 2)), 3 * unit.plant.step_s)  # the kernel's last sample, which its trace does not show
    assert one.count("rate_clamped") == counts[kernels.COUNT_CLAMPED] > 10
    assert one.count("slew_limited") == counts[kernels.COUNT_SLEW] > 10
    assert one.count("faults") == 0


@pytest.mark.parametrize("version", ["2.0", AGAIN["3.0"]])
def test_a_plant_without_states_follows_the_kernel(slave, version):
    one, commands = slave("plays", version), walk(1)
    output, _, _ = by_kernel(play_mirror(), np.eye(1), IDEAL_DRIVE, commands, 2, 1e-5)
    assert_follows(driven(one, commands, 2e-5), output)


def spring_by_kernel(unit, of, commands, steps):
    """Outputs of the kernel's mirror behind each command, held over so many plant steps, and the drives at the end."""
    u, drives = np.zeros(commands.shape[1]), []
    for command in np.repeat(commands, steps, axis=0):
        u = u + np.clip((command - u) * unit.follow, -unit.slew_step_v, unit.slew_step_v)
        drives.append(u)
    plant, output = mirror.discretise(of, unit.plant.step_s), np.empty((len(drives), of.axes))
    kernels.open_loop(plant, mirror.at_rest(plant), np.array(drives), output, np.empty((len(drives), 0)))
    return output[steps - 1 :: steps], u


@pytest.mark.promise("export-32")
def test_a_spring_of_several_axes_follows_the_kernel(slave):
    """Hysteresis in the stiffness with a polynomial beside its plays, beyond whose reach the walk goes."""
    unit, own = UNITS["spring"](), spring().mirror
    one, commands = slave("spring", "3.0"), walk(3)
    found = driven(one, commands, 4 * unit.plant.step_s, "mirror_m")
    output, drive = spring_by_kernel(unit, own, commands, 4)
    assert_follows(found, output)
    assert_follows(one.get("drive_v"), drive)
    assert_follows(one.get("line_of_sight_rad"), unit.optics @ output[-1])
    straight = replace(own, plays=(replace(own.plays[0], polynomial_rad=(0.0, 0.0, 0.0)), *own.plays[1:]))
    without, _ = spring_by_kernel(unit, straight, commands, 4)
    assert np.max(np.abs(without - output)) > 1e-3 * np.max(np.abs(output))
    assert np.max(np.abs(commands)) > BENT.reach_v
    assert one.get("prandtl_ishlinskii[1].reach_v")[0] == BENT.reach_v
    assert "prandtl_ishlinskii[2].reach_v" not in one.places


@pytest.mark.parametrize(("unit", "version"), [*(("rich", each) for each in VERSIONS), ("spring", "3.0")])
def test_each_parameter_has_a_place_of_its_own_that_holds_its_start_value(slave, unit, version):
    one = slave(unit, version)
    parameters = [v for v in one.description.modelVariables if v.causality == "parameter"]
    held = {v.name: one.get(v.name).tolist() for v in parameters}
    assert held == {v.name: [float(each) for each in v.start.split()] for v in parameters}
    assert any(name.startswith("prandtl_ishlinskii[2].weight") for name in held)


@pytest.mark.promise("export-30")
@pytest.mark.parametrize("version", VERSIONS)
def test_a_parameter_acts_when_it_is_set_before_the_begin(slave, version):
    models = everything().bouc_wen
    d1 = 2.0 * models[1].d1_rad_v
    other = replace(everything(), bouc_wen=(models[0], replace(models[1], d1_rad_v=d1, exponent=1.2)))
    commands = walk(2, 100)
    parameters = {"bouc_wen[2].d1_rad_v": d1, "bouc_wen[2].exponent": 1.2, "amplifier_bandwidth_hz": 500.0}
    found = driven(slave("rich", version, **parameters), commands, 2e-5)
    assert_follows(found, rich_by_kernel(commands, of=other, bandwidth_hz=500.0)[0])
    plain = rich_by_kernel(commands)[0]
    assert np.max(np.abs(found - plain)) > 0.01 * np.max(np.abs(plain))


# ------------------------------------------------------------------------------------------------- state and life cycle
@pytest.mark.promise("export-31")
@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_comes_back(slave, version):
    """Within an instance, as bytes into another one, and to the begin with its parameters by a reset."""
    unit, commands = rich_unit(), walk(2, 60)
    one = slave("rich", version, **{"amplifier_bandwidth_hz": 500.0})
    begun = driven(one, commands[:30], unit.plant.step_s)
    state, time = one.state(), one.time
    first = driven(one, commands[30:], unit.plant.step_s)
    one.restore(state, time)
    np.testing.assert_array_equal(driven(one, commands[30:], unit.plant.step_s), first)
    assert np.max(np.abs(first - begun)) > 0.0

    serialise = one.unit.serializeFMUstate if one.two else one.unit.serializeFMUState
    data = serialise(state)
    two = slave("rich", version)
    state_of_two = (two.unit.deSerializeFMUstate if two.two else two.unit.deserializeFMUState)(data)
    two.restore(state_of_two, time)
    np.testing.assert_array_equal(driven(two, commands[30:], unit.plant.step_s), first)
    (one.unit.freeFMUstate if one.two else one.unit.freeFMUState)(state)

    one.unit.reset()
    one.time = 0.0
    one.begin()
    again = driven(one, commands[:30], unit.plant.step_s)
    assert_follows(again, rich_by_kernel(commands[:30])[0])  # with the bandwidth of the design
    assert np.max(np.abs(again - begun)) > 0.0


@pytest.mark.promise("export-31")
@pytest.mark.parametrize(
    ("name", "version"), [("pointing", "2.0"), pytest.param("coupled", "3.0", marks=pytest.mark.endurance)]
)
def test_a_killed_process_is_continued_by_another_to_the_last_bit(archive, tmp_path, name, version):
    path, saved = archive(name, version), tmp_path / "state"
    command = [sys.executable, Path(slaves.__file__), path, tmp_path / "running", saved, "60", "120"]
    with subprocess.Popen([*command, "save"], stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout.readline() == "saved\n"
        running.kill()  # in the middle of further steps
    assert running.returncode == -signal.SIGKILL
    done = subprocess.run([*command, "continue"], capture_output=True, text=True, check=True)
    uninterrupted = slaves.shaken(Slave(path, tmp_path), range(120))
    wanted = [number.hex() for number in uninterrupted[60:].ravel().tolist()]
    assert json.loads(done.stdout) == wanted
    assert len(set(wanted)) > 60  # it moves


@pytest.mark.parametrize("version", VERSIONS)
def test_bytes_that_are_no_state_are_refused(slave, version):
    one = slave("rich", version)
    serialised = one.unit.serializeFMUstate if one.two else one.unit.serializeFMUState
    data = bytearray(serialised(one.state()))
    data[3] ^= 1
    with pytest.raises(FMICallException):
        (one.unit.deSerializeFMUstate if one.two else one.unit.deserializeFMUState)(bytes(data))
    assert one.said[-1].endswith("this is no state of this unit")


@pytest.mark.parametrize("version", VERSIONS)
def test_two_instances_do_not_know_each_other(slave, version):
    unit, commands = rich_unit(), walk(2, 50)
    one, two = slave("rich", version), slave("rich", version)
    found = []
    for command in commands:
        for each, sign in ((one, 1.0), (two, -0.5)):
            each.set("command_v", sign * command)
            each.step(unit.plant.step_s)
        found.append((one.get("mirror_rad"), two.get("mirror_rad")))
    assert_follows([a for a, _ in found], rich_by_kernel(commands)[0])
    assert_follows([b for _, b in found], rich_by_kernel(-0.5 * commands)[0])


@pytest.mark.promise("export-30")
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("steps", [0.5, 2.00001, 0.0, -1.0, np.nan, np.inf])
def test_a_part_of_a_plant_step_is_refused(slave, version, steps):
    unit = rich_unit()
    one, other = slave("rich", version), slave("rich", version)
    commands = walk(2, 3)
    driven(one, commands, unit.plant.step_s), driven(other, commands, unit.plant.step_s)
    with pytest.raises(FMICallException):
        one.unit.doStep(currentCommunicationPoint=one.time, communicationStepSize=steps * unit.plant.step_s)
    assert one.said[-1].endswith("is no whole number of plant steps of 2e-05 s: choose a multiple of it")
    np.testing.assert_array_equal(driven(one, commands, unit.plant.step_s), driven(other, commands, unit.plant.step_s))


@pytest.mark.promise("export-30")
@pytest.mark.parametrize("version", VERSIONS)
def test_a_step_is_whole_up_to_rounding(slave, version):
    """What differences of times leave is no part of a step, also late in a simulation."""
    unit = rich_unit()
    for start in (0.0, 1e7):
        one = slave("rich", version)
        one.set("command_v", [1.0, 1.0])
        one.time = start
        for k in range(20):
            now, then = start + k * 3 * unit.plant.step_s, start + (k + 1) * 3 * unit.plant.step_s
            one.unit.doStep(currentCommunicationPoint=now, communicationStepSize=then - now)
        assert_follows(one.get("mirror_rad"), rich_by_kernel(np.ones((20, 2)), 3)[0][-1])


@pytest.mark.parametrize("version", VERSIONS)
def test_another_guid_is_refused(archive, tmp_path, version):
    with pytest.raises(Exception, match="instantiate"):
        Slave(archive("rich", version), tmp_path, guid="{00000000-0000-0000-0000-000000000000}")
    assert Slave(archive("rich", version), tmp_path).get("drive_v").size == 2


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("name", "value", "wanted"),
    [
        ("amplifier_bandwidth_hz", -1.0, "finite and positive"),
        ("prandtl_ishlinskii[1].threshold_v[2]", -0.1, "finite and not negative"),
        ("bouc_wen[1].d1_rad_v", np.nan, "finite"),
    ],
)
def test_an_impossible_parameter_is_refused(slave, version, name, value, wanted):
    one = slave("rich", version, start=False)
    whole = name.removesuffix("[2]")
    with pytest.raises(FMICallException):
        if name in one.places:
            one.begin({name: value})
        else:
            one.set(whole, np.where(np.arange(3) == 1, value, one.get(whole)))
            one.begin()
    assert one.said[-1] == f"parameter {name} is {value:g}: it has to be {wanted}"


@pytest.mark.promise("export-30")
def test_parameters_of_a_closed_loop_are_the_mirrors_and_its_inverse_stays(slave):
    """The first command is made before the mirror has moved: by the inverse that was designed."""
    name = "bouc_wen[1].d1_rad_v"
    designed = slave("loop", "3.0")
    changed = slave("loop", "3.0", **{name: 1.5 * designed.get(name)[0]})
    period_s, commands, moved = tracking().setup.timing.period_s, [], []
    for one in (designed, changed):
        one.set("reference_rad", [1e-4])
        one.step(period_s)
        commands.append(one.get("command_v")[0])
        for _ in range(20):
            one.step(period_s)
        moved.append(one.get("mirror_rad")[0])
    assert commands[0] == commands[1] != one.get("bias_v")[0]
    assert abs(moved[1] / moved[0] - 1.0) > 0.01


@pytest.mark.promise("export-30")
@pytest.mark.parametrize("version", VERSIONS)
def test_what_cannot_be_set_is_refused(slave, version):
    one = slave("rich", version)
    before, drives = one.get("bouc_wen[1].d1_rad_v"), "drive_v[1]" if one.two else "drive_v"
    for name, message in (
        ("bouc_wen[1].d1_rad_v", "bouc_wen[1].d1_rad_v cannot be set once the simulation has begun"),
        (drives, f"{drives} cannot be set"),
    ):
        with pytest.raises(FMICallException):
            one.set(name, [1.0] * (one.sizes[name] or 1))
        assert one.said[-1] == message
    with pytest.raises(FMICallException):
        (one.unit.getReal if one.two else one.unit.getFloat64)([10_000])
    assert "no such variable with the value reference 10000" in one.said[-1]
    with pytest.raises(FMICallException):
        one.unit.enterInitializationMode()
    assert one.said[-1].endswith("EnterInitializationMode is called at the wrong time")
    np.testing.assert_array_equal(one.get("bouc_wen[1].d1_rad_v"), before)


@pytest.mark.parametrize("version", VERSIONS)
def test_an_input_that_is_no_number_is_refused(slave, version):
    unit, one = rich_unit(), slave("rich", version)
    one.set("command_v", [0.0, np.nan])
    with pytest.raises(FMICallException):
        one.step(unit.plant.step_s)
    assert one.said[-1] == "input command_v[2] is nan at 0 s: it has to be finite"
    one.set("command_v", [1.0, 1.0])
    one.step(unit.plant.step_s)
    assert np.all(np.isfinite(one.get("mirror_rad")))


# ------------------------------------------------------------------------------------------------------ other machines
SCRIPT = """
import json, sys
import numpy as np
try:
    import microrad
except ImportError:
    found = {"microrad": False}
else:
    found = {"microrad": True}
import fmpy
wanted = json.load(open(sys.argv[2]))
signal = np.array(list(zip(wanted["time"], wanted["reference"])), dtype=[("time", float), ("reference_rad[1]", float)])
result = fmpy.simulate_fmu(
    sys.argv[1],
    stop_time=wanted["time"][-1],
    output_interval=wanted["period"],
    input=signal,
    output=["line_of_sight_rad[1]"],
)
found["line_of_sight_rad"] = result["line_of_sight_rad[1]"].tolist()
found["fmpy"] = fmpy.__file__
print(json.dumps(found))
"""


def distributions(name):
    """A distribution and all that it needs here, by name."""
    found, left = {}, [name]
    while left:
        name = left.pop()
        try:
            of = importlib.metadata.distribution(name)
        except importlib.metadata.PackageNotFoundError:
            continue
        if of.metadata["Name"] not in found:
            found[of.metadata["Name"]] = of
            needed = [Requirement(each) for each in of.requires or ()]
            left += [each.name for each in needed if each.marker is None or each.marker.evaluate({"extra": ""})]
    return found.values()


def fresh_environment(folder):
    """A virtual environment with FMPy and what it needs, as links to what is installed here; returns its Python."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    for of in distributions("fmpy"):
        for top in {Path(str(file)).parts[0] for file in of.files or ()} - {"..", "__pycache__"}:
            if not (packages / top).exists():
                (packages / top).symlink_to(Path(str(of.locate_file(top))))
    return folder / "bin" / "python"


@pytest.mark.skipif(os.name != "posix", reason="links")
def test_it_runs_where_there_is_no_microrad(archive, tmp_path):
    trace, timing = sine(25.0), tracking().setup.timing
    samples = 500
    data = {"time": trace.time_s[: samples + 1].tolist(), "period": timing.period_s}
    data["reference"] = trace.reference_rad[: samples + 1, 0].tolist()
    (tmp_path / "reference.json").write_text(json.dumps(data))
    (tmp_path / "script.py").write_text(SCRIPT)
    python = fresh_environment(tmp_path / "fresh")
    copy = shutil.copy(archive("loop", "2.0"), tmp_path / "here.fmu")
    command = [python, "-I", "script.py", copy, "reference.json"]  # without PYTHONPATH and the user's own packages
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["microrad"] is False
    assert Path(found["fmpy"]).is_relative_to(tmp_path / "fresh")
    assert_follows(found["line_of_sight_rad"], trace.output_rad[: samples + 1, 0])


@pytest.mark.promise("export-28")
def test_without_a_compiler_it_holds_sources_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(fmu, "compiler", lambda: None)
    made = fmu.write_unit(UNITS["mirror"](), tmp_path / "bare.fmu", "3.0", "bare")
    assert made.platform is None
    assert made.words == (f"{made.path}: FMI 3.0, sources alone: no C compiler was found; compile it where it is used")
    assert validate_fmu(str(made.path)) == []
    with zipfile.ZipFile(made.path) as opened:
        assert not [each for each in opened.namelist() if each.startswith("binaries/")]
    assert fmpy.supported_platforms(str(made.path)) == ["c-code"]


def test_a_compiler_that_fails_is_said_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(fmu, "SHARED", (*fmu.SHARED, "-include", "missing.h"))
    with pytest.raises(ExportError, match=r"the C compiler '.*' refuses the FMI 2.0 unit 'mirror':\n  .*missing\.h"):
        fmu.write_unit(UNITS["mirror"](), tmp_path / "mirror.fmu", "2.0", "mirror")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_leaves_the_old_file(tmp_path, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(fmu, "compiler", lambda: None)  # sources alone, which are quicker
    path = tmp_path / "mirror.fmu"
    path.write_text("old")
    with monkeypatch.context() as patched, pytest.raises(OSError, match="No space"):
        patched.setattr(os, "fsync", full)
        fmu.write_unit(UNITS["mirror"](), path, "2.0", "mirror")
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]
    fmu.write_unit(UNITS["mirror"](), path, "2.0", "mirror")
    assert zipfile.is_zipfile(path) and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("version", "name", "message"),
    [
        ("1.0", "mirror", "FMI '1.0' is not written here: choose 2.0 or 3.0"),
        ("2.0", "two words", "'two words' is no name for exported code"),
        ("2.0", "a" * 28, "has 28 characters: at most 27"),
    ],
)
def test_other_versions_and_names_are_refused(tmp_path, monkeypatch, version, name, message):
    monkeypatch.setattr(fmu, "compiler", lambda: None)
    with pytest.raises(ExportError, match=message):
        fmu.write_unit(UNITS["mirror"](), tmp_path / "mirror.fmu", version, name)
    assert list(tmp_path.iterdir()) == []
    assert fmu.write_unit(UNITS["mirror"](), tmp_path / "mirror.fmu", "2.0", "a" * 27).path.exists()


def test_an_input_that_no_sensor_delivers_is_refused():
    unit = UNITS["loop"]()
    first, *rest = unit.controller.inputs
    other = replace(unit.controller, inputs=(Signal("star_rad", 1, "rad", first.meaning, first.limit), *rest))
    with pytest.raises(ExportError, match="reads star_rad, which a loop does not measure: it has optical_error_rad"):
        fmu.unit_code(replace(unit, controller=other), "2.0", "loop")
    assert "loop_loop.c" in fmu.unit_code(unit, "2.0", "loop")


HARSH = """
import sys
import fmpy
from fmpy.fmi1 import FMICallException
import numpy as np
rng = np.random.default_rng(1)
for path in sys.argv[1:]:
    description = fmpy.read_model_description(path)
    step = {v.name: v for v in description.modelVariables}["plant_step_s"].start
    inputs = [(v.name, float, v.shape) for v in description.modelVariables if v.causality == "input"]
    for size in (1e-6, 1.0, 1e9, 1e300):
        signal = np.zeros(300, dtype=[("time", float), *inputs])
        signal["time"] = np.arange(300) * float(step)
        for name, _, shape in inputs:
            signal[name] = rng.normal(size=(300, *shape)) * size
        try:
            result = fmpy.simulate_fmu(path, stop_time=signal["time"][-1], output_interval=float(step), input=signal)
            print("done", size, len(result))
        except FMICallException as error:
            print("refused", size, error)
"""


@pytest.mark.skipif(sys.platform != "linux" or shutil.which("gcc") is None, reason="gcc's sanitizer")
def test_nothing_in_it_is_undefined(archive, tmp_path):
    """Both versions, the richest mirror and a loop, under inputs from small to absurd."""
    folders = []
    for name, version in (("rich", "3.0"), ("pointing", "2.0")):
        folder = tmp_path / name
        fmpy.extract(archive(name, version), folder)
        (library,) = (folder / "binaries").glob("*/*")
        sources = sorted(str(each) for each in (folder / "sources").glob("*.c"))
        checks = ("-O1", "-fsanitize=undefined,float-divide-by-zero,float-cast-overflow", "-fno-sanitize-recover=all")
        subprocess.run(["gcc", *fmu.SHARED, *checks, "-o", library, *sources, "-lm"], check=True)
        folders.append(folder)
    command = [sys.executable, "-c", HARSH, *map(str, folders)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "runtime error" not in done.stderr
    said = [line for line in done.stdout.splitlines() if line.startswith(("done", "refused"))]
    assert len(said) == 8 and sum(line.startswith("done") for line in said) >= 6


# ------------------------------------------------------------------------------------------ what a unit says of itself
def spoken(unit, version):
    return [
        [
            v.name,
            v.place,
            v.causality,
            v.unit,
            v.size,
            None if v.start is None else [float(f"{x:.6g}") for x in v.start],
        ]
        for v in variables(unit, version)
    ]


def test_each_variable_of_a_plant_with_all_there_is_has_its_place_unit_and_start():
    assert spoken(rich_unit(), "3.0") == [
        ["time", "time_s", "independent", "s", None, None],
        ["command_v", "command_v", "input", "V", 2, [0.0, 0.0]],
        ["line_of_sight_rad", "line_of_sight_rad", "output", "rad", 3, None],
        ["mirror_rad", "plant.y", "output", "rad", 2, None],
        ["drive_v", "plant.u", "output", "V", 2, None],
        ["rate_clamped", "plant.rate_clamped", "output", "", None, None],
        ["slew_limited", "plant.slew_limited", "output", "", None, None],
        ["faults", "plant.faults", "output", "", None, None],
        ["amplifier_bandwidth_hz", "plant.amplifier_bandwidth_hz", "parameter", "Hz", None, [2000.0]],
        ["amplifier_slew_v_s", "plant.amplifier_slew_v_s", "parameter", "V/s", None, [1000.0]],
        ["bouc_wen[1].d1_rad_v", "plant.bouc_wen[0].d1", "parameter", "rad/V", None, [9e-05]],
        ["bouc_wen[1].d2_s_v", "plant.bouc_wen[0].d2", "parameter", "s/V", None, [-3e-07]],
        ["bouc_wen[1].epsilon_rad_v", "plant.bouc_wen[0].epsilon", "parameter", "rad/V", None, [-4.8e-05]],
        ["bouc_wen[1].delta_s_v", "plant.bouc_wen[0].delta", "parameter", "s/V", None, [0.00047]],
        ["bouc_wen[1].alpha_1_v", "plant.bouc_wen[0].alpha", "parameter", "1/V", None, [38.4]],
        ["bouc_wen[1].beta_1_v", "plant.bouc_wen[0].beta", "parameter", "1/V", None, [34.6]],
        ["bouc_wen[1].gamma_1_v", "plant.bouc_wen[0].gamma", "parameter", "1/V", None, [0.0]],
        ["bouc_wen[1].eta_1_v", "plant.bouc_wen[0].eta", "parameter", "1/V", None, [0.0]],
        ["bouc_wen[1].rate_limit_v_s", "plant.bouc_wen[0].rate_limit", "parameter", "V/s", None, [400.0]],
        ["bouc_wen[1].bias_v", "plant.bouc_wen[0].bias", "parameter", "V", None, [6.0]],
        ["bouc_wen[1].exponent", "plant.exponent[0]", "parameter", "", None, [1.0]],
        ["bouc_wen[2].d1_rad_v", "plant.bouc_wen[1].d1", "parameter", "rad/V", None, [8e-05]],
        ["bouc_wen[2].d2_s_v", "plant.bouc_wen[1].d2", "parameter", "s/V", None, [0.0]],
        ["bouc_wen[2].epsilon_rad_v", "plant.bouc_wen[1].epsilon", "parameter", "rad/V", None, [-2e-05]],
        ["bouc_wen[2].delta_s_v", "plant.bouc_wen[1].delta", "parameter", "s/V", None, [0.0]],
        ["bouc_wen[2].alpha_1_v", "plant.bouc_wen[1].alpha", "parameter", "1/V", None, [2.4]],
        ["bouc_wen[2].beta_1_v", "plant.bouc_wen[1].beta", "parameter", "1/V", None, [0.6]],
        ["bouc_wen[2].gamma_1_v", "plant.bouc_wen[1].gamma", "parameter", "1/V", None, [0.1]],
        ["bouc_wen[2].eta_1_v", "plant.bouc_wen[1].eta", "parameter", "1/V", None, [-0.2]],
        ["bouc_wen[2].rate_limit_v_s", "plant.bouc_wen[1].rate_limit", "parameter", "V/s", None, [math.inf]],
        ["bouc_wen[2].bias_v", "plant.bouc_wen[1].bias", "parameter", "V", None, [5.0]],
        ["bouc_wen[2].exponent", "plant.exponent[1]", "parameter", "", None, [1.7]],
        ["prandtl_ishlinskii[1].widening_s", "plant.widening_s[0]", "parameter", "s", None, [0.0002]],
        ["prandtl_ishlinskii[1].rate_limit_v_s", "plant.rate_limit_v_s[0]", "parameter", "V/s", None, [300.0]],
        ["prandtl_ishlinskii[1].threshold_v", "plant.threshold_v", "parameter", "V", 3, [0.0, 0.3, 0.9]],
        ["prandtl_ishlinskii[1].weight_rad_v", "plant.weight", "parameter", "rad/V", 3, [5e-05, 2e-05, 1e-05]],
        ["prandtl_ishlinskii[2].widening_s", "plant.widening_s[1]", "parameter", "s", None, [0.0]],
        ["prandtl_ishlinskii[2].rate_limit_v_s", "plant.rate_limit_v_s[1]", "parameter", "V/s", None, [math.inf]],
        ["prandtl_ishlinskii[2].threshold_v", "plant.threshold_v", "parameter", "V", 2, [0.0, 0.5]],
        ["prandtl_ishlinskii[2].weight_rad_v", "plant.weight", "parameter", "rad/V", 2, [4e-05, 1e-05]],
        ["bias_v", "constants[0]", "local", "V", None, [6.0]],
        ["plant_step_s", "constants[1]", "local", "s", None, [2e-05]],
    ]


def test_gains_of_a_plant_that_counts_in_volts_have_other_names():
    unit = replace(rich_unit(), element_unit="V", output_unit="m")
    named = {name: unit_ for name, _, _, unit_, _, _ in spoken(unit, "3.0")}
    usual = {name: unit_ for name, _, _, unit_, _, _ in spoken(rich_unit(), "3.0")}
    assert {name: unit_ for name, unit_ in named.items() if usual.get(name) != unit_} == {
        "mirror_m": "m",
        "bouc_wen[1].d1": "",
        "bouc_wen[1].epsilon": "",
        "bouc_wen[2].d1": "",
        "bouc_wen[2].epsilon": "",
        "prandtl_ishlinskii[1].weight": "",
        "prandtl_ishlinskii[2].weight": "",
    }


def test_arrays_are_their_elements_in_the_older_version_in_the_same_order():
    new, old = spoken(rich_unit(), "3.0"), spoken(rich_unit(), "2.0")
    assert len(old) == sum(each[4] or 1 for each in new)
    starts = [x for each in new if each[5] is not None for x in each[5]]
    assert [x for each in old if each[5] is not None for x in each[5]] == starts


def test_a_loop_shows_its_signals_counters_and_constants_behind_each_other():
    unit = UNITS["loop"]()
    of = replace(unit.controller, period_s=4e-4, minimum_v=-4.5, maximum_v=7.25)
    plant = replace(rich_unit(), bias_v=6.5)
    unit = replace(unit, plant=plant, controller=of, delay_steps=7)
    listed = [v for v in variables(unit, "3.0") if v.causality != "parameter"]
    named = [(v.name, v.place, v.causality, v.unit, v.size, v.variability, v.initial) for v in listed]
    whole = ("output", "", None, "discrete", "calculated")
    counters = [(each[0], each[1], *whole) for each in description.PLANT_COUNTERS + description.CONTROLLER_COUNTERS]
    assert named[1:-6] == [
        ("reference_rad", "reference_rad", "input", "rad", 3, "continuous", None),
        ("disturbance_rad", "disturbance_rad", "input", "rad", 3, "continuous", None),
        ("error_rad", "error_rad", "output", "rad", 3, "continuous", "calculated"),
        ("command_v", "loop.command_v", "output", "V", 2, "continuous", "calculated"),
        ("line_of_sight_rad", "line_of_sight_rad", "output", "rad", 3, "continuous", "calculated"),
        ("mirror_rad", "plant.y", "output", "rad", 2, "continuous", "calculated"),
        ("drive_v", "plant.u", "output", "V", 2, "continuous", "calculated"),
        *counters,
    ]
    assert [(v.name, v.place, v.unit, v.start, v.variability, v.initial) for v in listed[-6:]] == [
        (name, f"constants[{i}]", unit, (value,), "constant", "exact")
        for i, (name, unit, value) in enumerate([
            ("bias_v", "V", 6.5), ("plant_step_s", "s", 2e-5), ("control_period_s", "s", 4e-4),
            ("computation_delay_s", "s", pytest.approx(1.4e-4)), ("command_minimum_v", "V", -4.5),
            ("command_maximum_v", "V", 7.25),
        ])
    ]  # fmt: skip
    second = next(v for v in listed if v.name == "error_rad").elements[1]
    assert (second.name, second.place, second.size) == ("error_rad[2]", "error_rad[1]", None)
    assert second.dependencies == ("reference_rad[2]", "disturbance_rad[2]")
    plays = next(v for v in variables(unit, "3.0") if v.name == "prandtl_ishlinskii[2].weight_rad_v")
    assert (plays.begin, [(e.name[-3:], e.place, e.start) for e in plays.elements]) == (
        "plant.weight[3]", [("[1]", "plant.weight[3]", (4e-5,)), ("[2]", "plant.weight[4]", (1e-5,))]
    )  # fmt: skip


def test_what_a_unit_is_called_has_its_names_and_step_on_one_line():
    of = UNITS["loop"]()
    named = replace(of, controller=replace(of.controller, name="PI\n\tone"), plant=rich_unit())
    end = f'internal step 2e-05 s. Mission: a <mission> & "more", sha256 {"0" * 64}.'
    assert description._described(named) == (
        "all there */ is, closed loop of PI one",
        f"Amplifier, mirror with hysteresis, sensors and controller PI one, {end}",
    )
    assert description._described(rich_unit()) == (
        "all there */ is", f"Amplifier and fast steering mirror with hysteresis, {end}"
    )  # fmt: skip


@pytest.mark.parametrize(
    ("system", "machine", "wide", "old", "new", "ending"),
    [
        ("linux", "x86_64", True, "linux64", "x86_64-linux", ".so"),
        ("linux", "i686", False, "linux32", "x86-linux", ".so"),
        ("linux", "x86_64", False, "linux32", "x86-linux", ".so"),  # Python of 32 bits
        ("linux", "aarch64", True, "linux64", "aarch64-linux", ".so"),
        ("linux", "RISCV64", True, "linux64", "riscv64-linux", ".so"),
        ("darwin", "arm64", True, "darwin64", "aarch64-darwin", ".dylib"),
        ("win32", "AMD64", True, "win64", "x86_64-windows", ".dll"),
        ("cygwin", "x86", False, "win32", "x86-windows", ".dll"),
        ("freebsd14", "amd64", True, "linux64", "x86_64-linux", ".so"),
    ],
)
def test_a_library_stands_in_the_folder_of_its_system_and_machine(monkeypatch, system, machine, wide, old, new, ending):
    here = SimpleNamespace(platform=system, maxsize=2**63 - 1 if wide else 2**31 - 1)
    monkeypatch.setattr(fmu, "sys", here)
    monkeypatch.setattr(fmu.platform, "machine", lambda: machine)
    assert (fmu._platform("2.0"), fmu._platform("3.0"), fmu._ending()) == (old, new, ending)


def test_an_archive_begins_with_its_description_and_has_libraries_that_may_be_run(tmp_path):
    contents = {"sources/b.c": b"2", "binaries/x/z.so": b"4", "a.txt": b"1", "modelDescription.xml": b"0" * 900}
    (tmp_path / "x.fmu").write_bytes(fmu._archive(contents))
    with zipfile.ZipFile(tmp_path / "x.fmu") as found:
        listed = [(e.filename, e.external_attr >> 16, e.create_system, e.date_time) for e in found.infolist()]
        assert {name: found.read(name) for name in found.namelist()} == contents
        assert found.infolist()[0].compress_size < 100
    epoch = (1980, 1, 1, 0, 0, 0)
    assert listed == [
        ("modelDescription.xml", 0o100644, 3, epoch), ("a.txt", 0o100644, 3, epoch),
        ("binaries/x/z.so", 0o100755, 3, epoch), ("sources/b.c", 0o100644, 3, epoch),
    ]  # fmt: skip


def test_a_loop_takes_each_reading_from_where_it_is_measured():
    unit = UNITS["loop"]()
    first = unit.controller.inputs[0]
    names = ["gauge_rad", "reference_rad", "optical_error_rad"]
    inputs = tuple(Signal(name, 1, "rad", first.meaning, first.limit) for name in names)
    made = replace(unit, controller=replace(unit.controller, inputs=inputs), field_of_view_rad=3e-3)
    found = fmu._loop_values(made)
    assert found["arguments"] == ["gauge_rad", "reference_rad", "loop->reading_rad"]
    assert [found[key] for key in ("optical", "gauge", "reading", "reference")] == [True, True, False, True]
    assert found["field_of_view_rad2"] == pytest.approx(9e-6)
    wide = fmu._loop_values(replace(made, field_of_view_rad=math.inf))
    assert wide["field_of_view_rad2"] == sys.float_info.max
    other = replace(made.controller, inputs=(*inputs, *(replace(inputs[0], name=n) for n in ("star", "moon"))))
    with pytest.raises(ExportError) as told:
        fmu._loop_values(replace(made, controller=replace(other, name="PI")))
    assert str(told.value) == (
        "controller 'PI' reads star, moon, which a loop does not measure: it has optical_error_rad, gauge_rad, "
        "reading_rad, reference_rad"
    )


# ----------------------------------------------------------------------- a compiler that does not come through
@pytest.mark.parametrize(
    ("raised", "reason"),
    [
        (subprocess.TimeoutExpired(["mycc", "x"], 300.0), "timed out after 300.0 seconds"),
        (PermissionError(13, "Permission denied"), "Permission denied"),
    ],
)
def test_a_compiler_that_does_not_end_or_begin_is_told_with_the_version(monkeypatch, raised, reason):
    def broken(command, **more):
        raise raised

    monkeypatch.setattr(fmu, "compiler_words", lambda: ("mycc", "-m64"))
    monkeypatch.setattr(fmu.subprocess, "run", broken)
    with pytest.raises(ExportError) as told:
        fmu._library({"sources/a.c": "int a;"}, "3.0", "mirror")
    assert str(told.value).startswith("the C compiler 'mycc' cannot compile the FMI 3.0 unit: ")
    assert reason in str(told.value) and told.value.__cause__ is raised


@pytest.mark.parametrize(("ending", "shared"), [(".so", True), (".dylib", True), (".dll", False)])
def test_the_sources_of_a_unit_are_compiled_in_their_order_into_a_library_of_its_name(monkeypatch, ending, shared):
    asked = []

    def compiled(command, cwd, timeout, **more):
        asked.append((command, sorted(each.name for each in cwd.iterdir()), timeout))
        (cwd / command[command.index("-o") + 1]).write_bytes(b"library")
        return SimpleNamespace(returncode=0, stderr="")

    monkeypatch.setattr(fmu, "compiler_words", lambda: ("mycc", "-m64"))
    monkeypatch.setattr(fmu, "_ending", lambda: ending)
    monkeypatch.setattr(fmu.subprocess, "run", compiled)
    texts = {"sources/b.c": "2", "sources/b.h": "h", "modelDescription.xml": "<x/>", "sources/a.c": "1"}
    assert fmu._library(texts, "2.0", "tip") == b"library"
    ((command, files, timeout),) = asked
    flags = [each for each in fmu.SHARED if shared or each != "-fPIC"]
    assert command == ["mycc", "-m64", *flags, "-o", f"tip{ending}", "a.c", "b.c", "-lm"]
    assert (files, timeout) == (["a.c", "b.c", "b.h"], fmu.TIME_LIMIT_S)


@pytest.mark.parametrize("count", [1, 12, 15])
def test_a_compiler_that_refuses_is_shown_by_its_first_twelve_lines(monkeypatch, count):
    lines = [f"line {n}" for n in range(count)]
    done = SimpleNamespace(returncode=1, stderr="\n".join(lines) + "\n")
    monkeypatch.setattr(fmu, "compiler_words", lambda: ("mycc",))
    monkeypatch.setattr(fmu.subprocess, "run", lambda command, **more: done)
    with pytest.raises(ExportError) as told:
        fmu._library({}, "2.0", "tip")
    first, *shown = str(told.value).split("\n")
    assert first == "the C compiler 'mycc' refuses the FMI 2.0 unit 'tip':"
    assert shown == [f"  {each}" for each in lines[:12]]


@pytest.mark.parametrize("version", VERSIONS)
def test_a_unit_that_differs_in_one_text_or_the_name_of_a_file_has_another_guid(monkeypatch, version):
    code = {"a_unit.c": "1", "a_unit.h": "2"}
    guids = []
    for changed in (
        code,
        code,
        {"a_unit.c": "12", "a_unit.h": ""},
        {"a_unit.h": "1", "a_unit.c": "2"},
        {**code, "b.h": ""},
    ):
        monkeypatch.setattr(fmu, "unit_code", lambda unit, version, name, changed=changed: changed)
        texts, guid = fmu._texts(UNITS["mirror"](), version, "a")
        assert re.fullmatch(r"\{[0-9a-f]{8}-[0-9a-f]{4}-5[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}\}", guid)
        assert all(guid in texts[file] for file in ("modelDescription.xml", f"sources/fmi{version[0]}.c"))
        assert {f"sources/{file}" for file in (*changed, *fmu.HEADERS[version])} < set(texts)
        guids.append(guid)
    assert guids[0] == guids[1] and len(set(guids)) == 4


@pytest.mark.parametrize("version", VERSIONS)
def test_a_description_has_the_steps_of_its_unit_and_each_unknown_by_its_place(monkeypatch, version):
    given = {}
    monkeypatch.setattr(description, "render", lambda template, **values: given.update(values) or template)
    loop = UNITS["loop"]()
    loop = replace(loop, plant=rich_unit(), controller=replace(loop.controller, period_s=4e-4))
    for unit, step_s in ((loop, 4e-4), (rich_unit(), 2e-5)):
        template = description.model_description(unit, version, "tip", "{guid}", ("a.c", "b.c"))
        assert template == f"model_description_{version[0]}.xml.j2"
        assert (given["step_s"], given["plant_step_s"]) == (step_s, pytest.approx(2e-5))
        assert (given["name"], given["guid"], given["compiled"]) == ("tip", "{guid}", ("a.c", "b.c"))
        listed = given["variables"]
        assert [listed[i].name for i, _ in given["unknowns"]] == [v.name for v in listed if v.causality == "output"]
        behind = {listed[i].name: [listed[d].name for d in others] for i, others in given["unknowns"] if others}
        axes = range(1, 4) if unit is loop else ()
        ends = [""] * bool(axes) if version == "3.0" else [f"[{i}]" for i in axes]
        assert behind == {f"error_rad{end}": [f"reference_rad{end}", f"disturbance_rad{end}"] for end in ends}
