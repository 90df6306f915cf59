"""What a function reads of frozen records, told field by field."""

import copy
import functools
import math
import os
import pickle
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import date, datetime, time, timedelta
from enum import Enum
from pathlib import Path, PureWindowsPath
from types import MappingProxyType

import numpy as np
import pytest
from pydantic import BaseModel, ConfigDict

from microrad.core.reads import Reads, UnknownValueError, digest, watched_call


class Kind(Enum):
    LEFT, RIGHT = "left", "right"


@dataclass(frozen=True, slots=True)
class Beam:
    power_w: float
    waist_m: float = 0.02

    @property
    def doubled_w(self):
        return 2.0 * self.power_w


class Table(BaseModel):
    model_config = ConfigDict(frozen=True)
    rate_hz: float
    delay_s: float = 0.0
    mode: str | None = None

    @property
    def period_s(self):
        return 1.0 / self.rate_hz


@dataclass(frozen=True, slots=True)
class Mission:
    beam: Beam
    loop: Table
    beams: tuple[Beam, ...] = ()
    sources: Mapping[str, Beam] | None = None
    samples: np.ndarray | None = None


MISSION = Mission(
    Beam(5.0), Table(rate_hz=1e3), (Beam(1.0), Beam(2.0)), {"a": Beam(3.0), "b": Beam(4.0)}, np.arange(3.0)
)


def agree(function, changed, mission=MISSION):
    """Whether what a function has read of a mission is the same in a changed one."""
    _, reads = watched_call(function, mission)
    assert reads.agree((mission,))
    return reads.agree((changed,))


OTHER_POWER = replace(MISSION, beam=Beam(6.0))
OTHER_WAIST = replace(MISSION, beam=Beam(5.0, 0.03))
OTHER_RATE = replace(MISSION, loop=Table(rate_hz=2e3))
OTHER_DELAY = replace(MISSION, loop=Table(rate_hz=1e3, delay_s=1e-3))
OTHER_FIRST = replace(MISSION, beams=(Beam(9.0), Beam(2.0)))
ONE_MORE = replace(MISSION, beams=(Beam(1.0), Beam(2.0), Beam(3.0)))
OTHER_A = replace(MISSION, sources={"a": Beam(7.0), "b": Beam(4.0)})
WITH_C = replace(MISSION, sources={"a": Beam(3.0), "b": Beam(4.0), "c": Beam(1.0)})
OTHER_SAMPLES = replace(MISSION, samples=np.array([0.0, 1.0, 2.0000000001]))


@pytest.mark.promise("report-4")
@pytest.mark.parametrize(
    ("function", "seen", "unseen"),
    [
        (lambda m: m.beam.power_w, OTHER_POWER, OTHER_WAIST),
        (lambda m: m.beam.doubled_w, OTHER_POWER, OTHER_WAIST),
        (lambda m: m.loop.period_s, OTHER_RATE, OTHER_DELAY),
        (lambda m: m.loop.mode is None, replace(MISSION, loop=Table(rate_hz=1e3, mode="x")), OTHER_DELAY),
        (lambda m: m.beams[0].power_w, OTHER_FIRST, OTHER_POWER),
        (lambda m: m.beams[1].power_w, ONE_MORE, OTHER_FIRST),
        (lambda m: [b.waist_m for b in m.beams], ONE_MORE, OTHER_FIRST),
        (lambda m: m.sources["a"].power_w, OTHER_A, WITH_C),
        (lambda m: m.sources["b"].power_w, replace(MISSION, sources={"a": Beam(3.0)}), OTHER_A),
        (lambda m: m.sources.get("c"), WITH_C, OTHER_A),
        (lambda m: "c" in m.sources, WITH_C, OTHER_A),
        (lambda m: len(m.sources), WITH_C, OTHER_A),
        (lambda m: {**m.sources, "d": 1}["a"].power_w, OTHER_A, OTHER_POWER),
        (lambda m: m.samples[0], OTHER_SAMPLES, OTHER_POWER),
        (lambda m: isinstance(m.beam, Beam), replace(MISSION, beam=Table(rate_hz=1.0)), OTHER_POWER),
        # what cannot be seen into is read whole
        (lambda m: m.loop.model_copy(update={"rate_hz": 1.0}), OTHER_DELAY, OTHER_POWER),
        (lambda m: m.loop.model_dump(), OTHER_DELAY, OTHER_POWER),
        (lambda m: replace(m.beam, waist_m=1.0), OTHER_POWER, OTHER_RATE),
        (lambda m: hash(m.beam), OTHER_WAIST, OTHER_RATE),
        (lambda m: m.beam == Beam(5.0), OTHER_WAIST, OTHER_RATE),
        (lambda m: m.loop == Table(rate_hz=1.0), OTHER_DELAY, OTHER_POWER),
        (lambda m: copy.copy(m.loop), OTHER_DELAY, OTHER_POWER),
        (lambda m: copy.deepcopy(m.beam), OTHER_WAIST, OTHER_RATE),
    ],
)
def test_what_is_read_is_noted_and_nothing_else(function, seen, unseen):
    assert not agree(function, seen)
    assert agree(function, unseen)


def test_a_result_that_holds_a_record_depends_on_all_of_it():
    result, reads = watched_call(lambda m: {"beam": m.beam}, MISSION)
    plain = pickle.loads(pickle.dumps(result))
    assert type(plain["beam"]) is Beam
    assert plain["beam"] == MISSION.beam
    assert reads.agree((OTHER_RATE,))
    assert not reads.agree((OTHER_WAIST,))


def test_a_result_that_holds_a_mapping_depends_on_all_of_it():
    result, reads = watched_call(lambda m: [m.sources], MISSION)
    assert pickle.loads(pickle.dumps(result)) == [MISSION.sources]
    assert not reads.agree((WITH_C,))


def test_a_watched_record_stands_for_its_own():
    def look(m):
        return m.beam, type(m.beam).__name__, m.beam.__class__, repr(m.beam), m.beam is m.beam, m.beam == MISSION.beam

    (beam, name, kind, text, same, equal), _ = watched_call(look, MISSION)
    assert (name, kind, text, same, equal) == ("Beam", Beam, repr(MISSION.beam), True, True)
    with pytest.raises(AttributeError):
        beam.power_w = 1.0


def test_arguments_that_are_no_records_are_read_as_they_are_given():
    _, reads = watched_call(lambda a, b: None, 1.0, "x")
    assert reads.agree((1.0, "x"))
    assert not reads.agree((1.0, "y"))
    assert not reads.agree((1.0,))


@pytest.mark.promise("report-4")
@pytest.mark.parametrize(
    ("one", "other"),
    [
        (0.0, -0.0),
        (1, 1.0),
        (1, True),
        ("1", 1),
        (b"1", "1"),
        (None, "None"),
        (0.1, math.nextafter(0.1, 1.0)),
        ((1, 2), [1, 2]),
        ((1, (2,)), ((1, 2),)),
        ({"a": 1}, {"b": 1}),
        (np.arange(6.0), np.arange(6.0).reshape(2, 3)),
        (np.arange(3), np.arange(3.0)),
        (np.float64(1.0), 1.0),
        (Kind.LEFT, Kind.RIGHT),
        (Path("a"), "a"),
        (slice(1, 2), slice(1, 3)),
        ({1, 2}, {1, 3}),
        (Beam(1.0), Beam(1.0, 0.01)),
        (math.sin, math.cos),
        (functools.partial(math.pow, 1.0), functools.partial(math.pow, 2.0)),
        (float, int),
    ],
)
def test_values_that_differ_have_different_digests(one, other):
    assert digest(one) != digest(other)
    assert digest(one) == digest(copy.deepcopy(one))


def test_another_process_finds_the_same_digests():
    code = "from microrad.core.reads import digest; print(digest({'a': (1.5, {'x', 'y', 'z'}), 'b': None}).hex())"
    found = {
        subprocess.run(
            [sys.executable, "-c", code], env={"PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True
        ).stdout
        for seed in ("1", "2")
    }
    assert found == {digest({"a": (1.5, {"x", "y", "z"}), "b": None}).hex() + "\n"}


@dataclass(frozen=True)
class Nothing:
    pass


@dataclass(frozen=True)
class NothingElse:
    pass


@dataclass(frozen=True)
class Told:
    number: float

    def __reduce__(self):
        return Told, (round(self.number),)


def test_a_record_without_fields_is_known_by_its_kind_and_one_that_tells_by_what_it_tells():
    assert digest(Nothing()) == digest(Nothing()) != digest(NothingElse())
    assert digest(Told(1.1)) == digest(Told(0.9)) != digest(Told(2.1))


def holds_a_value():
    inside = 3.0
    return lambda: inside


@pytest.mark.parametrize("value", [object(), np.array([object()]), holds_a_value(), iter([])])
def test_what_has_no_digest_is_refused(value):
    with pytest.raises(UnknownValueError):
        digest((1, value))


def test_a_function_that_holds_no_value_has_the_digest_of_its_name():
    assert digest(holds_a_value) == digest(holds_a_value) != digest(test_what_has_no_digest_is_refused)


def test_nothing_read_agrees_with_anything():
    assert Reads().agree(("anything",))


@pytest.mark.skipif(sys.platform != "linux" or os.cpu_count() == 1, reason="nothing is forked")
def test_what_only_a_forked_process_would_read_is_read_here():
    code = """
import os
from dataclasses import dataclass
from microrad.core.reads import watched_call
from microrad.core.threads import shared_out

@dataclass(frozen=True)
class Beam:
    power_w: float
    waist_m: float

caller = os.getpid()

def two(beam):
    def job():
        return beam.power_w, os.getpid()
    with shared_out([job, job]) as results:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT)  # the other process has had both turns
        return results()

found, reads = watched_call(two, Beam(2.0, 0.01))
assert found == [(2.0, caller)] * 2, found
assert [path[-1] for path in reads.digests if path[1:]] == ["power_w"], reads.digests
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")


@dataclass(frozen=True)
class Swapped:
    waist_m: float
    power_w: float


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (date(2026, 1, 2), date(2026, 1, 3)), (datetime(2026, 1, 2), date(2026, 1, 2)), (time(1, 2), time(2, 1)),
        (timedelta(seconds=1), timedelta(seconds=2)), (Path("a/b"), PureWindowsPath("a/b")),
        ({1: 2, 3: 4}, {3: 4, 1: 2}),
        ({"a": 1}, {"a": 2}), ({1}, frozenset({1, 2})), (slice(1, 2, 3), slice(1, 2, 4)), (slice(1, 9), slice(2, 9)),
        ([], ()), ([], [None]), (range(3), range(4)), (functools.partial(max, 1), functools.partial(min, 1)),
        (functools.partial(round, 1.0), functools.partial(round, 1.0, ndigits=2)), (Beam(1.0, 2.0), Swapped(2.0, 1.0)),
        (Table(rate_hz=1.0), Table(rate_hz=1.0, mode="")), (np.zeros(2, np.float32), np.zeros(2)), (math.nan, math.inf),
        (np.arange(4).reshape(2, 2), np.arange(4).reshape(2, 2).T), (np.zeros(0), np.zeros((0, 1))), (b"", ""), (0, ""),
        (np.int32(1), np.int64(1)), (np.array(1.0), np.array([1.0])), ("a\0b", "ab"),
        (Kind.LEFT, "left"),
        ((("a", "b"), "c"), ("a", ("b", "c"))), (("a", "bc"), ("ab", "c")), ((1, 23), (12, 3)), (len, sum),
        (dict, list), (np.array([1, 2], ">i4"), np.array([1, 2], "<i4")),
    ],
)  # fmt: skip
def test_values_that_are_nearly_alike_have_digests_of_their_own(one, other):
    assert digest(one) != digest(other)


def test_views_of_an_array_have_the_digest_of_what_is_in_them():
    whole = np.arange(12.0).reshape(3, 4)
    assert (
        digest(whole[:, ::2]) == digest(np.ascontiguousarray(whole[:, ::2])) == digest(np.asfortranarray(whole[:, ::2]))
    )
    assert digest({3, 1, 2}) == digest({2, 3, 1}) and digest({"a": 1}) == digest(MappingProxyType({"a": 1}))


@pytest.mark.parametrize(
    ("function", "paths"),
    [
        (lambda m: None, ["0"]),
        (lambda m: m.beam.waist_m, ["0", "0 beam", "0 beam waist_m"]),
        (lambda m: m.beams[1].power_w, ["0", "0 beams", "0 beams 0", "0 beams 1", "0 beams 1 power_w"]),
        (lambda m: (m.samples, m.samples), ["0", "0 samples"]),
        (lambda m: m.loop.period_s, ["0", "0 loop", "0 loop rate_hz"]),
    ],
)
def test_what_is_read_stands_under_the_steps_that_lead_to_it(function, paths):
    _, reads = watched_call(function, MISSION)
    assert [" ".join(map(str, path)) for path in reads.digests if path] == paths and reads.known


def test_arguments_beside_and_what_has_no_digest_are_known_for_what_they_are():
    result, reads = watched_call(lambda a, *, b: (a, b), 1.5, b=object)
    assert (result, reads.known, list(reads.digests)) == ((1.5, object), True, [()])
    _, reads = watched_call(lambda m, x: m.beam.power_w, MISSION, iter([]))
    assert not reads.known


LISTED = replace(
    MISSION,
    beams=[Beam(1.0), Beam(2.0)],
    sources={"a": [Beam(3.0), Beam(4.0)], "b": (Beam(5.0),), "c": [[Beam(6.0)], [Beam(7.0)]]},
)


@pytest.mark.parametrize(
    ("function", "seen", "unseen"),
    [
        (lambda m: m.beams[0].power_w, {"beams": [Beam(9.0), Beam(2.0)]}, {"beams": [Beam(1.0), Beam(9.0)]}),
        (lambda m: m.beams[1].power_w, {"beams": [Beam(1.0)]}, {"beams": [Beam(1.0, 9.0), Beam(2.0, 9.0)]}),
        (lambda m: len(m.beams), {"beams": (Beam(1.0), Beam(2.0))}, {"beams": [Beam(8.0), Beam(9.0)]}),
        (
            lambda m: m.sources["a"][1].power_w,
            {"sources": {**LISTED.sources, "a": [Beam(3.0), Beam(9.0)]}},
            {"sources": {**LISTED.sources, "a": [Beam(9.0), Beam(4.0)], "b": ()}},
        ),
        (
            lambda m: m.sources["c"][1][0].power_w,
            {"sources": {**LISTED.sources, "c": [[Beam(6.0)], [Beam(9.0)]]}},
            {"sources": {**LISTED.sources, "c": [[Beam(9.0)], [Beam(7.0)]]}},
        ),
        (
            lambda m: sorted(m.sources),
            {"sources": {name: LISTED.sources[name] for name in ("b", "a", "c")}},
            {"sources": {"a": [], "b": [Beam(1.0)], "c": ()}},
        ),
    ],
)
def test_of_records_in_lists_and_in_lists_of_a_mapping_those_that_are_read_count(function, seen, unseen):
    assert not agree(function, replace(LISTED, **seen), LISTED)
    assert agree(function, replace(LISTED, **unseen), LISTED)


@pytest.mark.parametrize("place", [None, 3.0, "xyz", (), Beam(3.0), {}])
@pytest.mark.parametrize(
    "function", [lambda m: sorted(m.sources), lambda m: m.sources["a"][1].power_w, lambda m: "b" in m.sources]
)
def test_what_was_read_of_a_mapping_is_not_in_anything_else(function, place):
    assert not agree(function, replace(LISTED, sources=place), LISTED)
    assert agree(function, replace(LISTED, beams=place), LISTED)


@pytest.mark.parametrize("function", [lambda m: list(m.sources), lambda m: len(m.sources), lambda m: {**m.sources}])
def test_the_keys_of_a_mapping_are_known_in_the_order_that_they_stand_in(function):
    sources = {"x": [Beam(3.0)], "b": [Beam(4.0)], "k": [Beam(5.0)]}
    mission = replace(LISTED, sources=sources)
    assert agree(function, replace(mission, sources=dict(sources), beams=[]), mission)
    for keys in ("bkx", "xkb", "xb", "xbkz"):
        assert not agree(function, replace(mission, sources={key: sources.get(key, []) for key in keys}), mission)


def test_a_name_of_a_file_of_any_bytes_has_a_digest_of_its_own():
    names = [os.fsdecode(each) for each in (b"a\xff.csv", b"a\xfe.csv", b"a.csv")]
    assert len({digest(each) for name in names for each in (name, Path(name))}) == 6
    assert digest(Path(names[0])) == digest(Path(os.fsdecode(b"a\xff.csv")))
