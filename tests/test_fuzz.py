"""Bad inputs: some of each format of `scripts/fuzz`, what has fallen before, and what the script makes of a find."""

import os
import signal
from random import Random

import numpy as np
import pytest

from fuzzing import mutate, properties, run, seeds
from fuzzing.formats import FORMATS
from preset_files import EXAMPLES, completed
from waiting import HANG_S

FALLEN = sorted(path for path in seeds.BAD.glob("*/*") if path.is_file())
CASES = 8
"""Of each format; `scripts/fuzz` has more."""


@pytest.mark.parametrize("name", FORMATS)
def test_bad_inputs_are_refused_in_words_or_keep_what_must_hold(name):
    tally = run.here(FORMATS[name], 1, range(CASES), HANG_S)
    assert tally.finds == []
    assert tally.cases == CASES


@pytest.mark.parametrize("path", FALLEN, ids=lambda path: str(path.relative_to(seeds.BAD)))
def test_what_has_fallen_before_does_so_no_more(path, tmp_path):
    _, what, trace = run.judged(FORMATS[path.parent.name], path.read_bytes(), tmp_path, HANG_S)
    assert not what, trace


@pytest.mark.parametrize("name", ["links", "tdms", "manifests", "ledgers", "drafts", "recording"])
def test_a_case_is_the_same_each_time(name):
    made = [repr(run.case(FORMATS[name], 3, number)) for number in (7, 8, 7)]
    assert made[0] == made[2] != made[1]


def test_what_a_case_changes_is_its_own():
    """Later ones would begin with what an earlier one has made of the values, or hold them in a circle."""
    before, data = repr(mutate.VALUES), {"a": [1, {"b": "c"}], "d": 2.0}
    for number in range(2000):
        mutate.plain(Random(number), data, data)
    assert repr(mutate.VALUES) == before
    assert data == {"a": [1, {"b": "c"}], "d": 2.0}


class Fake:
    """A format of which case 2 is a find of some kind, 0 is taken, and all others are refused."""

    name, most_bytes = "fake", 50_000_000

    def __init__(self, falls, most_s=HANG_S):
        self.falls, self.most_s = falls, most_s

    def made(self, draw):
        return draw.random()

    def take(self, made, folder):
        number = next(n for n in range(9) if run.case(self, 1, n) == made)
        if number == 2:
            self.falls()
        if number:
            raise run.DocumentedError("a word")


def breaks():
    raise AssertionError("a property is broken")


def says_nothing():
    raise run.DocumentedError(" ")


def never_ends():
    while True:
        pass


def crashes():
    os.kill(os.getpid(), signal.SIGKILL)


def grows():
    assert np.ones(20_000_000).sum() > 0.0


FALLS = {
    "a traceback": (Fake(lambda: {}["x"]), "KeyError: 'x'"),
    "a broken property": (Fake(breaks), "AssertionError: a property is broken"),
    "no word": (Fake(says_nothing), "DocumentedError without a word"),
    "a hang": (Fake(never_ends, 0.1), "TooLongError: more than 0.1 s"),
    "a crash": (Fake(crashes), "ends the process: status 9"),
    "memory": (Fake(grows), "takes 0.2 GB"),
}


@pytest.mark.parametrize(("fake", "what"), FALLS.values(), ids=FALLS)
def test_a_find_is_kept_and_the_run_goes_on(fake, what, tmp_path):
    tally = run.apart(fake, 1, range(4), tmp_path / "finds")
    (find,) = tally.finds
    assert (find.number, tally.taken, tally.refused) == (2, 1, 2)
    assert what in find.what
    assert (tmp_path / "finds" / "fake-1-2.txt").read_text(encoding="utf-8").startswith(find.what)
    assert (tmp_path / "finds" / "fake-1-2.input").exists()


@pytest.mark.parametrize("name", EXAMPLES)
def test_each_preset_keeps_what_must_hold(name, tmp_path):
    """The range of some is typed; that of others follows from an altitude and an elevation."""
    properties.links(completed(tmp_path, name))
