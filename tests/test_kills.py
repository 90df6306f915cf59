"""Commands that are killed at random moments, a thousand kills in `make endurance` alone: see kills.py.

Campaigns, workers of Dask and jobs of the studio are killed in their own tests, too, and test_faults_at_writes.py looks
at what a command leaves that is killed at one of its writes.
"""

import pytest

import kills


@pytest.mark.endurance
@pytest.mark.parametrize("name", kills.VICTIMS)
def test_what_a_kill_leaves_is_whole_and_going_on_ends_as_if_nothing_had_been(name, tmp_path):
    if "Dask" in name:
        pytest.importorskip("distributed")
    assert sum(kills.killed(name, 200, seed=1, place=tmp_path).values()) == 200
