"""Commands that are killed at random moments: `run` and `identify` once, each command 200 times in `make endurance`.

See kills.py. Campaigns, workers of Dask and jobs of the studio are killed in their own tests, too, and
test_faults_at_writes.py looks at what a command leaves that is killed at one of its writes.
"""

import pytest

import kills

ONCE = ("run", "identify")
"""Those that no other test kills at a random moment."""


@pytest.mark.parametrize(
    ("name", "count"),
    [*((name, 1) for name in ONCE), *(pytest.param(name, 200, marks=pytest.mark.endurance) for name in kills.VICTIMS)],
)
def test_what_a_kill_leaves_is_whole_and_going_on_ends_as_if_nothing_had_been(name, count, tmp_path):
    if "Dask" in name:
        pytest.importorskip("distributed")
    assert sum(kills.killed(name, count, seed=1, place=tmp_path).values()) == count
