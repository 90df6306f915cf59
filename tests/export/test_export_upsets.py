"""Flight code whose state upsets change: every bit is turned, at many moments of a run, alone and one upon another."""

import os
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

import designs
from export.test_export_adaptive import learning
from export.test_export_flight import PAIRS, pair
from microrad.export.flight import c_code, fixed
from microrad.export.flight.rounding import RoundingBound
from microrad.export.linear_part.sections import sections

FLIPS = 10_000 if os.environ.get("MICRORAD_ENDURANCE") else 4000
BEHIND = 6  # samples that are looked at behind each flip
FLAGS = ["-std=c99", "-O1", "-g", "-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
BOUND = RoundingBound(command_v=1e-3, samples=1, per_sample_v=0.0, words="For tests.")

HARNESS = """
#include "{name}.h"
#include <stdio.h>
#include <string.h>
static const {reading} READING[{samples}][{readings}] = {{ {values} }};
static void step({name}_state *state, int k, {value} command[{actuators}])
{{ const {reading} *m = READING[k % {samples}]; (void)m; {name}_step(state, {arguments}, command); }}
int main(void)
{{
    {name}_state state, turned;
    {value} command[{actuators}];
    unsigned long flips = 0, outside = 0, counted = 0;
    int k = 0;
    {name}_init(&state);
    while (flips < {flips}) {{
        for (size_t bit = 0; bit < 8 * sizeof state; bit++, flips++) {{
            if (bit % 97 == 0) step(&state, k++, command); /* another moment */
            turned = state;
            ((unsigned char *)&turned)[bit / 8] ^= (unsigned char)(1u << (bit % 8));
            for (int i = 0; i < {behind}; i++) {{
                step(&turned, k + i, command);
                for (int a = 0; a < {actuators}; a++)
                    outside += !(command[a] >= {low} && command[a] <= {high});
            }}
            counted += turned.{counter} != state.{counter};
        }}
    }}
    for (unsigned long one = 0; one < {flips}; one++, flips++) {{ /* and one upon the other, with no rest between */
        size_t bit = (size_t)(one * 2654435761u >> 7) % (8 * sizeof state);
        ((unsigned char *)&state)[bit / 8] ^= (unsigned char)(1u << (bit % 8));
        for (int i = 0; i < 3; i++) {{
            step(&state, k++, command);
            for (int a = 0; a < {actuators}; a++)
                outside += !(command[a] >= {low} && command[a] <= {high});
        }}
    }}
    printf("%lu %lu %lu\\n", flips, outside, counted);
    return 0;
}}
"""


def turned(folder, of, files, name, counter, values, limits):
    """Flips, commands outside of the limits, and flips that were counted."""
    places = np.cumsum([0, *(each.size for each in of.inputs)])[:-1]
    whole = values.dtype.kind == "i"
    written = "{%s}"
    rows = ", ".join(written % ", ".join(map(repr, row)) for row in values.tolist())
    for file, text in files.items():
        (folder / file).write_text(text, encoding="utf-8")
    text = HARNESS.format(
        name=name,
        reading="int32_t" if whole else f"{name}_real",
        value="int32_t" if whole else f"{name}_real",
        samples=len(values),
        readings=values.shape[1],
        values=rows,
        actuators=of.actuators,
        arguments="m" if whole else ", ".join(f"m + {at}" for at in places),
        flips=FLIPS,
        behind=BEHIND,
        counter=counter,
        low=limits[0],
        high=limits[1],
    )
    (folder / "upsets.c").write_text(text, encoding="utf-8")
    sources = ["upsets.c", *(file for file in files if file.endswith(".c") and not file.endswith("_bench.c"))]
    subprocess.run(["gcc", *FLAGS, "-o", "upsets", *sources, "-lm"], cwd=folder, check=True)
    done = subprocess.run(["./upsets"], cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return map(int, done.stdout.split())


LEARNS = "an inverse that learns"
FLOWN = [
    ("PI + inverse", "double"),
    ("LQG", "single"),
    (LEARNS, "single"),
    *zip(PAIRS, ("single", "double", "single"), strict=True),
]
PARTS = ("LQG", "exponent 2 without a limit of rate, plays that creep")
"""What has no part of its state that another one does not have, too."""
FLOWN = [
    *(pytest.param(*each, marks=[pytest.mark.endurance] if each[0] in PARTS else []) for each in FLOWN),
    *(
        pytest.param(name, "double" if precision == "single" else "single", marks=pytest.mark.endurance)
        for name, precision in FLOWN
    ),
]
"""Each code in one precision, and in the other one where there is time."""


def flown(name):
    """A controller by its name, or with the inverse of a pair of models, and a recorded run."""
    if name == LEARNS:
        return learning(0.305e-3, samples=300)
    return pair(PAIRS[name]) if name in PAIRS else designs.flown(name, 300)


@pytest.mark.promise("export-6", "export-18")
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
@pytest.mark.parametrize(("name", "precision"), FLOWN)
def test_no_bit_of_the_state_takes_a_command_beyond_the_limits(tmp_path, name, precision):
    of, run = flown(name)
    files = c_code.flight_code(of, sections(of), "flown", precision, BOUND)
    number = np.float64 if precision == "double" else np.float32
    limits = "FLOWN_COMMAND_MIN_V", "FLOWN_COMMAND_MAX_V"
    values = run.inputs[:300].astype(number)
    flips, outside, counted = turned(tmp_path, of, files, "flown", "upsets", values, limits)
    assert flips >= 2 * FLIPS
    assert outside == 0
    assert counted > 0


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
@pytest.mark.parametrize(
    "name", ["PI + inverse", *(pytest.param(n, marks=pytest.mark.endurance) for n in ("LQG", LEARNS))]
)
def test_nor_in_fixed_point_and_nothing_overflows(tmp_path, name):
    of, run = flown(name)
    form = sections(of)
    run = replace(run, inputs=run.inputs[:300])
    made = fixed.quantised(of, form, run, 32)
    files = fixed.fixed_code(of, form, made, "flown")
    whole = np.rint(run.inputs / made.input_scale).astype(np.int64).clip(-(2**31) + 1, 2**31 - 1).astype(np.int32)
    most = int(of.maximum_v / of.resolution_v)
    flips, outside, counted = turned(tmp_path, of, files, "flown_fixed", "overflowed", whole, (-most, most))
    assert flips >= 2 * FLIPS
    assert outside == 0
    assert counted > 0
