"""The same digits behind the linear algebra of other processors: a reduced case, each side with nothing kept."""

import contextlib
import io
import os
import re
import subprocess
import sys

import pytest

from microrad.core import machine
from shipped import SHIPPED

_CASE = """
import numpy as np
from microrad import load_mission, mirror
from microrad.link import tracking_light_w
from microrad.loop import controller_study

file = load_mission({path!r})
scene = controller_study.scene(file, mirror.of(file.mission), tracking_light_w(file))
found = controller_study.design_and_simulate_one(scene, {name!r})
print(found.design.tuned.values)
for variant, of in sorted(found.simulated.items()):
    print(variant, of.rms_rad, of.quantile_rad, of.largest_rad)
"""


def told(path, name, machine, **more):
    """What one controller of a mission is tuned to and leaves, each number to its last digit."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OPENBLAS_CORETYPE": machine, **more}
    ran = subprocess.run(
        [sys.executable, "-c", _CASE.format(path=str(path), name=name)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return ran.stdout


@pytest.mark.promise("decisions-1", "sampled-loop-12")
@pytest.mark.promise("pointing-13", "sampled-loop-12")
@pytest.mark.endurance
@pytest.mark.parametrize(
    ("name", "machines"), [("LQG", ("Prescott", "Haswell")), ("PI + notch", ("Prescott", "Haswell", "Zen"))]
)
def test_the_shipped_loop_is_tuned_and_simulated_to_the_same_digits_on_another_processor(name, machines):
    one, *others = (told(SHIPPED, name, machine) for machine in machines)
    assert all(other == one for other in others)
    assert one.count("rad") == 0 and one.count("\n") >= 4


_SEVERAL_AXES = """
from microrad.loop import coupled_study
from several_axes import scene_of, three_actuators

for each in coupled_study.design(scene_of(three_actuators()), only=("PI", "LQG")).made:
    print(each.name, each.values)
    print([f"{1e6 * rad:.3f} urad" for rad in each.residual_rad])
    print(f"{each.margins.modulus:.3f}, {each.margins.disk.disk:.3f}")
"""


@pytest.mark.promise("pointing-81")
@pytest.mark.endurance
def test_a_loop_of_several_axes_is_tuned_to_the_same_values_on_another_processor():
    path = os.pathsep.join(sys.path)
    own = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": path}
    one, other = (
        subprocess.run(
            [sys.executable, "-c", _SEVERAL_AXES],
            env={**own, "OPENBLAS_CORETYPE": machine},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for machine in ("Prescott", "Haswell")
    )
    assert one == other
    assert one.count("urad") == 4


@pytest.mark.promise("pointing-14")
@pytest.mark.endurance
def test_loops_without_fused_multiply_add_leave_the_same_to_the_tolerance_of_runs():
    """Two steps of the sensor's converter over the root of 64 runs, as docs/report.md has it."""
    numbers = re.compile(r"^(given|comparison|no hysteresis) ([0-9.e-]+)", re.MULTILINE)
    plain = {"NUMBA_CPU_NAME": "x86-64-v2", "NUMBA_CPU_FEATURES": "+sse4.2,+avx,-fma"}
    one, other = (numbers.findall(told(SHIPPED, "PI", "Prescott", **more)) for more in ({}, plain))
    assert len(one) == 3 and [name for name, _ in one] == [name for name, _ in other]
    for (_, own), (_, without) in zip(one, other, strict=True):
        assert float(without) == pytest.approx(float(own), abs=6.8e-9, rel=0.0)


def test_a_processor_without_vectors_is_named_by_what_it_has():
    environment = {**os.environ, "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}
    code = "from microrad.core.machine import machine; print(machine()['instruction sets'])"
    ran = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert ran.stdout.strip()
    assert "AVX2" not in ran.stdout and "X86_V3" not in ran.stdout


_DIGITS = """
import numpy as np
from microrad.mirror.hysteresis import BoucWen

drive = 5.0 * np.sin(np.arange(2000) / 30.0)
model = BoucWen(89e-6, 0.0, -22e-6, 4e-4, 2.4, 0.6, rate_limit_v_s=2000.0)
for each in (np.exp(drive), model.response(drive, 1e-4)):
    print(" ".join(value.hex() for value in each.tolist()))
"""
_LESS_OF_NUMPY = {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}
_LESS_OF_THE_COMPILER = {"NUMBA_CPU_NAME": "x86-64-v2", "NUMBA_CPU_FEATURES": "+sse4.2,+avx,-fma"}


@pytest.mark.promise("campaigns-57")
@pytest.mark.skipif(
    not {"AVX2", "X86_V3"} & set(re.findall(r"\w+", machine.machine()["instruction sets"])),
    reason="this processor has nothing to be left unused",
)
def test_last_digits_of_arrays_and_of_hysteresis_are_those_of_a_kind_of_processor():
    def read(text):
        arrays, hysteresis = ([float.fromhex(each) for each in line.split()] for line in text.splitlines())
        return arrays, hysteresis

    def digits(**less):
        ran = subprocess.run(
            [sys.executable, "-c", _DIGITS], env={**os.environ, **less}, capture_output=True, text=True, check=True
        )
        return read(ran.stdout)

    with contextlib.redirect_stdout(io.StringIO()) as here:
        exec(_DIGITS, {})
    (arrays, hysteresis), again = read(here.getvalue()), digits()
    assert again == (arrays, hysteresis)
    other_arrays, other_hysteresis = digits(**_LESS_OF_NUMPY, **_LESS_OF_THE_COMPILER)
    # numpy's exponential has another kind for vectors of 512 bits alone
    assert (other_arrays != arrays) is bool(re.search("X86_V4|AVX512", machine.machine()["instruction sets"]))
    assert other_arrays == pytest.approx(arrays, rel=1e-14)
    assert other_hysteresis != hysteresis and other_hysteresis == pytest.approx(hysteresis, rel=1e-9, abs=1e-18)


@pytest.mark.parametrize(
    ("found", "told"), [(("glibc", "2.35"), "glibc 2.35"), (("musl", ""), "musl"), (("", ""), "Some-System-1")]
)
def test_a_machine_is_named_by_its_c_library_or_else_by_its_system(monkeypatch, found, told):
    monkeypatch.setattr(machine.platform, "libc_ver", lambda: found)
    monkeypatch.setattr(machine.platform, "platform", lambda terse: "Some-System-1" if terse else "long")
    assert machine.machine()["C library"] == told


@pytest.mark.parametrize(
    ("stated", "found"),
    [({"architecture": "a", "processor": "p"}, {"architecture": "a", "processor": "p"}), ("x86_64", {"architecture":
     "x86_64"}), ("", {}), (None, {}), ({}, {}), (7, {"architecture": "7"})],
)  # fmt: skip
def test_a_machine_of_an_older_manifest_is_its_architecture(stated, found):
    assert machine.as_stated(stated) == found


def test_variables_that_are_set_stand_behind_what_each_machine_has_in_their_order(monkeypatch):
    for name in machine.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.setenv("NUMBA_OPT", "")
    monkeypatch.setenv("OMP_NUM_THREADS_OF_ANOTHER", "5")
    found = machine.machine()
    assert list(found.items())[6:] == [("NUMBA_OPT", ""), ("OMP_NUM_THREADS", "3")]
    assert list(found)[:6] == [
        "architecture",
        "processor",
        "instruction sets",
        "C library",
        "numpy's BLAS",
        "scipy's BLAS",
    ]
    assert list(machine.versions()) == ["python", *machine.LIBRARIES]
