"""A call is made again with arguments in which something is another thing, and with no arguments that do harm."""

import math
import sys
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from reference import neighbours


@dataclass(frozen=True)
class Beam:
    """What a function of the package may be given."""

    width: float
    name: str = "wide"

    def __post_init__(self):
        if self.width < 0.0:
            raise ValueError("no width")


class Way(Enum):
    """A word that is one of a few."""

    UP = "up"


def call_of(function, *args, **keywords):
    """What is kept of a call."""
    kept = []

    def profile(frame, event, _):
        if event == "call" and frame.f_code is function.__code__ and not kept:
            kept.append(neighbours.called(frame))

    sys.setprofile(profile)
    try:
        with suppress(ValueError):
            function(*args, **keywords)
    finally:
        sys.setprofile(None)
    return kept[0]


values = partial(neighbours.values, numbers=range(neighbours.KINDS), limit_s=neighbours.HANG_S)

SEEN = []
"""What `noted` was given."""


def noted(*given):
    SEEN.append(given)


def changes(*args):
    """The numbers of the variations, and the arguments of each."""
    call = call_of(noted, *args)
    SEEN.clear()
    return [number for number, _ in values(call, "noted 1")], [*SEEN]


def test_each_number_becomes_another_one_and_one_of_them_turns_round_or_is_0():
    numbers, given = changes(2.0, [3.0, 5.0], Beam(7.0))
    rows = np.array([[one, *two, beam.width] for one, two, beam in given[: numbers.index(4)]])
    was = np.array([2.0, 3.0, 5.0, 7.0])
    for row in rows[:2]:
        assert np.all((row != was) & (row >= 0.8 * was) & (row <= 1.25 * was))
        assert len(set(row / was)) == 4, "not each by a factor of its own"
    assert np.all(rows[0] != rows[1])
    for row in rows[2:]:
        assert np.sum(row != was) == 1


def test_a_flag_a_word_a_number_of_things_and_an_element_become_others_one_at_a_time():
    assert {one for _, given in [changes(True)] for (one,) in given} == {False}
    assert {one for _, given in [changes(4)] for (one,) in given} <= {3, 5}
    assert all(one != "volt" for (one,) in changes("volt")[1])
    lines = "a\nb\nc\n"
    first, second = (one for (one,) in changes(lines)[1])
    assert (len(first), len(second)) == (4, 8)
    assert [len(one) for (one,) in changes((1, 2, 3))[1] if len(one) != 3] == [2, 4]
    assert [len(one) for (one,) in changes({"a": 1, "b": 2})[1] if len(one) != 2] == [1, 3]


def test_an_array_keeps_its_shape_and_a_number_of_things_beside_it_stays():
    was = np.arange(1.0, 7.0).reshape(2, 3)
    numbers, given = changes(was, 3)
    assert numbers == [0, 1, 2, 3]
    assert all(array.shape == was.shape and count == 3 for array, count in given)
    assert all(np.any(array != was) for array, _ in given)
    assert np.array_equal(given[2][0], -was)


def test_what_a_function_changes_or_raises_counts_and_a_generator_is_looked_into():
    def add(found, x):
        found.append(x)

    def refuse(x):
        raise ValueError(f"not {x:.3g}")

    def count(x):
        while True:
            yield x

    for function, args in [(add, ([], 1.0)), (count, (2.0,))]:
        found = dict(values(call_of(function, *args), "f 1"))
        assert found[0] != found[1]
    assert len(set(dict(values(call_of(refuse, 2.0), "f 1")).values())) == 4


def test_arguments_are_as_they_were_when_the_function_began_and_stay_so():
    def take(rest):
        return rest.pop()

    rest = [1.0, 2.0, 3.0]
    call = call_of(take, rest)
    assert rest == [1.0, 2.0]
    once = dict(values(call, "take 1"))
    assert once == dict(values(call, "take 1"))
    assert once != dict(values(call, "take 2"))
    assert rest == [1.0, 2.0]


def test_keywords_and_more_arguments_are_varied_as_well():
    def of(one, *more, factor=1.0):
        return one * factor + sum(more)

    assert len(dict(values(call_of(of, 1.0, 2.0, 3.0, factor=4.0), "of 1"))) == 4


@pytest.mark.parametrize(
    "argument",
    [
        Path("mission.toml"),
        sys.stderr,
        np.zeros(neighbours.LARGEST + 1),
        [0] * (neighbours.MOST_PARTS + 1),
        {"x": [Path()]},
    ],
    ids=["a path", "a stream", "a large array", "a long list", "a path inside"],
)
def test_a_call_that_could_do_harm_or_takes_long_is_not_made_again(argument):
    assert call_of(lambda of: of, argument) is None


def test_a_function_inside_of_another_one_and_an_enumeration_are_left_alone():
    outside = []

    def inner(x):
        outside.append(x)

    assert call_of(inner, 1.0) is None
    assert changes(Way.UP) == ([], [])


def test_a_call_that_would_tell_its_test_something_again_is_not_made_again():
    told = []
    assert call_of(lambda on_progress: on_progress(1.0), told.append) is None
    assert call_of(lambda on_progress: on_progress(1.0), lambda x: told.append(x)) is None  # noqa: PLW0108
    assert told == [1.0, 1.0]
    assert call_of(lambda scale: scale(1.0), lambda x: 2.0 * x) is not None


def test_nor_is_one_that_tells_it_through_a_function_of_the_package():
    told = []

    def around(function):
        def judge(x):
            return judge and function(x)

        judge.__module__ = "microrad.lab"
        return judge

    assert call_of(lambda judge: judge(4.0), around(told.append)) is None
    assert call_of(lambda judge: judge(4.0), around(around(told.append))) is None
    assert told == [4.0, 4.0]
    assert call_of(lambda judge: judge(4.0), around(math.sqrt)) is not None


def test_what_takes_long_is_stopped_and_refused_arguments_have_no_value():
    def forever(x):
        while x != 2.0:
            pass

    assert dict(neighbours.values(call_of(forever, 2.0), "f 1", [0, 1])) == {}

    def width(beam):
        return beam.width

    found = dict(values(call_of(width, Beam(3.0)), "w 1"))
    assert found.keys() >= {0, 1, 3}
    assert 2 not in found, "a beam of no width"


def test_a_higher_number_is_another_variation_of_the_same_kind_and_the_last_one_the_call_itself():
    call = call_of(noted, 2.0, 3.0)
    SEEN.clear()
    numbers = [2, 2 + neighbours.KINDS, 2 + 2 * neighbours.KINDS, neighbours.SAME]
    assert [number for number, _ in neighbours.values(call, "noted 1", numbers, neighbours.HANG_S)] == numbers
    assert {*SEEN[:3]} == {(-2.0, 3.0), (2.0, -3.0)}
    assert SEEN[3] == (2.0, 3.0)


def capped(x, most):
    return most if x > most else x


def test_a_call_shows_the_mistakes_with_which_it_returns_something_else(monkeypatch):
    """Those that none before it has shown."""
    monkeypatch.setattr(neighbours.mistakes, "OF_A_LINE", 99)
    call = call_of(capped, 2.0, 3.0)
    shown = neighbours.Shown(call[0])
    every = set(shown.left)
    x, first = shown.by(([2.0, 3.0], {}), neighbours.HANG_S)
    assert x == dict(neighbours.values(call, "f", [neighbours.SAME], neighbours.HANG_S))[neighbours.SAME]
    assert first
    assert shown.left == every - set(first)
    assert shown.by(([2.0, 3.0], {}), neighbours.HANG_S) == (x, [])
    _, second = shown.by(([4.0, 3.0], {}), neighbours.HANG_S)
    assert second
    assert not set(first) & set(second)


def twice_as_long(x, times):
    while x < 8.0:
        x = x * times
    return x


def test_a_mistake_with_which_a_call_does_not_end_is_not_shown_by_it(monkeypatch):
    """Such as `x = x / times`; the others are tried all the same."""
    monkeypatch.setattr(neighbours.mistakes, "OF_A_LINE", 99)
    call = call_of(twice_as_long, 2.0, 2.0)
    shown = neighbours.Shown(call[0])
    every = set(shown.left)
    _, seen = shown.by(([2.0, 2.0], {}), 0.2)
    assert seen
    assert shown.left == every - set(seen)
    assert shown.left
