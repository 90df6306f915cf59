"""Mistakes in a function are small, always the same ones, and of each kind."""

import copy

import pytest

from reference import mistakes


def larger(a, b):
    return a if a > b else b


def share(part, whole):
    return part / whole


def either(a, b, c):
    return bool(a or (b and c))


def worded(x):
    return f"{x:.1f} m"


def middle(values):
    return values[1:-1]


def signed(x):
    return -x


def odd(values):
    return [x for x in values if x % 2]


def told(said, x):
    said.append(x)
    return said


class Plate:
    """Of a size."""

    def __init__(self, width, height):
        self.width = width
        self.height = height

    def area(self):
        return self.width * self.height


class Thick(Plate):
    """It is not alone."""

    def area(self):
        return super().area() + 1.0


def results(function, *args):
    """What comes of a function with each mistake."""
    found = []
    for code in mistakes.of(function.__code__):
        wrong = type(function)(code, function.__globals__, closure=function.__closure__ if code.co_freevars else None)
        try:
            found.append(wrong(*copy.deepcopy(args)))
        except Exception as error:
            found.append(type(error))
    return found


def every(function, *args, monkeypatch):
    monkeypatch.setattr(mistakes, "OF_A_LINE", 99)
    return results(function, *args)


@pytest.mark.parametrize(
    ("function", "args", "wrong"),
    [
        (larger, (1.0, 2.0), [1.0]),
        (share, (3.0, 6.0), [18.0, 3.0, 1.0, None]),
        (either, (False, True, True), [False]),
        (either, (False, True, False), [True]),
        (worded, (1.25,), ["1.25 m", "1.2 mx", "1.2m", None]),
        (middle, ([1, 2, 3, 4],), [[1, 2, 3], [2, 3, 4], [3], [2]]),
        (signed, (1.0,), [1.0, None]),
        (odd, ([1, 2, 3],), [[1, 2, 3], [2, 3]]),
        (told, ([1], 2), [[1], None]),
        (Plate.area, (Plate(2.0, 3.0),), [2.0 / 3.0, 4.0, 9.0, None]),
        (Thick.area, (Thick(2.0, 3.0),), [5.0, 8.0, None]),
    ],
)
def test_each_kind_of_mistake_is_there(function, args, wrong, monkeypatch):
    found = every(function, *args, monkeypatch=monkeypatch)
    assert [each for each in wrong if each not in found] == []


def test_they_are_the_same_every_time_and_so_many_of_a_line(monkeypatch):
    first, again = (mistakes.of(share.__code__) for _ in range(2))
    assert len(first) == mistakes.OF_A_LINE
    assert [code.co_code for code in first] == [code.co_code for code in again]
    monkeypatch.setattr(mistakes, "MOST", 1)
    assert len(mistakes.of(share.__code__)) == 1


def test_functions_that_are_in_no_file_have_none():
    made = {}
    exec("def share(part, whole):\n    return part / whole", made)
    assert mistakes.of(made["share"].__code__) == []
    assert mistakes.of((lambda x: x + 1.0).__code__) == []
