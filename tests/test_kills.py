"""One kill of one command here, a thousand of all of them in `make endurance`: see kills.py.

Campaigns, workers of Dask and jobs of the studio are killed in their own tests, too, and test_faults_at_writes.py looks
at what a command leaves that is killed at one of its writes.
"""

import os

import pytest

import kills

OFTEN = bool(os.environ.get("MICRORAD_ENDURANCE"))


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name == "identify" else [pytest.mark.endurance]) for name in kills.VICTIMS],
)
def test_what_a_kill_leaves_is_whole_and_going_on_ends_as_if_nothing_had_been(name, tmp_path):
    if "Dask" in name:
        pytest.importorskip("distributed")
    count = 200 if OFTEN else 1
    assert sum(kills.killed(name, count, seed=1, place=tmp_path).values()) == count
