"""The same digits behind the linear algebra of other processors: a reduced case, each side with nothing kept."""

import os
import subprocess
import sys

import pytest

from shipped import SHIPPED

_CASE = """
import numpy as np
from microrad import load_mission, mirror
from microrad.link import tracking_light_w
from microrad.loop import fine_pointing

file = load_mission({path!r})
scene = fine_pointing.scene(file, mirror.of(file.mission), tracking_light_w(file))
found = fine_pointing.run_one(scene, {name!r})
print(found.design.tuned.values)
for variant, of in sorted(found.simulated.items()):
    print(variant, of.rms_rad, of.quantile_rad, of.largest_rad)
"""


def told(path, name, machine):
    """What one controller of a mission is tuned to and leaves, each number to its last digit."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OPENBLAS_CORETYPE": machine}
    ran = subprocess.run(
        [sys.executable, "-c", _CASE.format(path=str(path), name=name)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return ran.stdout


@pytest.mark.parametrize("name", ["LQG", pytest.param("PI + notch", marks=pytest.mark.endurance)])
def test_the_shipped_loop_is_tuned_and_simulated_to_the_same_digits_on_another_processor(name):
    one, other = (told(SHIPPED, name, machine) for machine in ("Prescott", "Haswell"))
    assert one == other
    assert one.count("rad") == 0 and one.count("\n") >= 4


def test_a_processor_without_vectors_is_named_by_what_it_has():
    environment = {**os.environ, "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}
    code = "from microrad.core.machine import machine; print(machine()['instruction sets'])"
    ran = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert ran.stdout.strip()
    assert "AVX2" not in ran.stdout and "X86_V3" not in ran.stdout
