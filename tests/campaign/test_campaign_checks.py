"""What a campaign file has to have, check by check: each condition by itself, and each limit at its very value."""

import contextlib
import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from made_tables import one_line
from microrad.campaign.definition import checks, distributions, draws, keys, values
from microrad.campaign.definition import records as definition_records
from microrad.campaign.definition.distributions import LogUniform, Normal, OneOf, Uniform, uncovered
from microrad.campaign.definition.outputs import OUTPUTS, RADIUS
from microrad.campaign.definition.records import Cell, Draw, Variable
from microrad.campaign.definition.values import NotedError
from microrad.campaign.records import Limit
from microrad.mirror import Variant
from microrad.mission.fields import OrWord, Quantity, Several, Share, Table, Whole
from microrad.mission.file import load_mission
from microrad.mission.toml import Document
from shipped import SHIPPED


class Noting:
    """A reader that notes faults, and reads numbers as they are."""

    def __init__(self):
        self.noted = []

    def fault(self, key, value, reason, expected, nearest=""):
        self.noted.append((key, value, reason, expected, nearest))
        return NotedError()

    def is_output(self, at, name, *others):
        known = name in OUTPUTS or name in others
        if not known:
            self.fault(at, name, "is no output", "")
        return known

    def table(self, at, model, raw):
        return model.model_validate(raw)

    def numbers(self, at, raw):
        return tuple(float(value) for _, value in raw.values())

    def number(self, at, rule, raw, example=""):
        return float(raw)

    def each(self, read, items):
        return tuple(read(*item) for item in items)

    @property
    def keys(self):
        return [key for key, *_ in self.noted]


# ----------------------------------------------------------------------------------------------------------- the loop
def loop(**changes):
    given = {"controller": "PI", "axes": "both", "mirror": Variant.GIVEN, "duration_s": None, "settle_s": None}
    return SimpleNamespace(**(given | changes))


@pytest.fixture
def mission(monkeypatch):
    """A mission with a loop whose controllers are known by name."""
    whole = load_mission(SHIPPED).mission

    def changed(mirror_file=None, duration_s=2.0, settle_s=0.5, comparison=True):
        fine = SimpleNamespace(mirror_file=mirror_file, duration_s=duration_s, settle_s=settle_s)
        mirror = SimpleNamespace(comparison=comparison, name="A")
        return whole.model_copy(update={"fine_pointing": fine, "mirror": mirror})

    monkeypatch.setattr(checks.controller_study, "names", lambda fine: ("PI", "LQG"))
    monkeypatch.setattr(checks.coupled_study, "names", lambda fine: ("PI", "MIMO"))
    return changed


@pytest.mark.parametrize(
    ("table", "fine", "key"),
    [
        ({}, {}, None),
        ({"controller": "LQG"}, {}, None),
        ({"controller": "MIMO"}, {}, "loop.controller"),
        ({"controller": "MIMO"}, {"mirror_file": "a.toml"}, None),
        ({"controller": "LQG"}, {"mirror_file": "a.toml"}, "loop.controller"),
        ({"axes": "one"}, {}, None),
        ({"axes": "one"}, {"mirror_file": "a.toml"}, "loop.axes"),
        ({"mirror": Variant.COMPARISON}, {"mirror_file": "a.toml"}, "loop.mirror"),
        ({"mirror": Variant.STRAIGHT}, {"mirror_file": "a.toml"}, None),
        ({"mirror": Variant.COMPARISON}, {}, None),
        ({"mirror": Variant.COMPARISON}, {"comparison": None}, "loop.mirror"),
        ({"mirror": Variant.STRAIGHT}, {"comparison": None}, None),
        ({}, {"duration_s": 0.5}, "loop.duration"),  # all of it settling
        ({}, {"duration_s": 0.501}, None),
        ({"duration_s": 0.4}, {}, "loop.duration"),
        ({"duration_s": 0.6}, {"duration_s": 0.1}, None),
        ({"settle_s": 2.0}, {}, "loop.duration"),
        ({"settle_s": 1.9}, {}, None),
        ({"settle_s": 0.0}, {"duration_s": 0.1}, None),  # no settling is not the mission's
        ({"duration_s": 3.0, "settle_s": 3.0}, {}, "loop.duration"),
    ],
)
def test_a_loop_has_its_controller_its_mirror_and_time_behind_the_settling(mission, table, fine, key):
    reader = Noting()
    checks.check_loop(reader, loop(**table), [mission(), mission(**fine)])
    if table.get("controller", "PI") == "MIMO":  # which the first mission does not have
        reader = Noting()
        checks.check_loop(reader, loop(**table), [mission(**fine)])
    assert reader.keys == [key] * (key is not None)


def test_every_mission_of_the_cells_needs_a_loop(mission):
    links = SimpleNamespace(fine_pointing=mission().fine_pointing)  # no whole mission
    without = mission().model_copy(update={"fine_pointing": None})
    for other in (links, without):
        reader = Noting()
        checks.check_loop(reader, loop(), [mission(), other, other])
        assert reader.keys == ["loop"]
        assert "[fine_pointing]" in reader.noted[0][2]


# ------------------------------------------------------------------------------------------------------------ outputs
def of_group(*groups):
    return tuple(name for name, output in OUTPUTS.items() if output.group in groups)


def test_what_is_kept_by_default_hangs_on_the_loop():
    looped, still = SimpleNamespace(loop=object()), SimpleNamespace(loop=None)
    reader = Noting()
    assert checks.kept(reader, None, looped) == checks.kept(reader, None, None) == of_group("residual", "link")
    assert checks.kept(reader, None, still) == of_group("link")
    assert checks.kept(reader, ["volume", "margin"], still) == tuple(n for n in OUTPUTS if n in ("volume", "margin"))
    assert reader.noted == []
    residual = of_group("residual")[0]
    assert checks.kept(reader, [residual], looped) == checks.kept(reader, [residual], None) == (residual,)
    assert reader.noted == []
    assert checks.kept(reader, [residual, "margin"], still) == tuple(n for n in OUTPUTS if n in (residual, "margin"))
    assert [(key, value) for key, value, *_ in reader.noted] == [("keep", residual)]


@pytest.mark.parametrize("raw", [[], "margin", {}, 0])
def test_nothing_to_keep_is_no_list(raw):
    reader = Noting()
    assert checks.kept(reader, raw, None) == ()
    assert reader.keys == ["keep"]


@pytest.mark.parametrize("raw", [None, ["a list of the file"]])
def test_an_output_of_a_table_that_a_mission_has_not_goes_or_is_refused(raw):
    keep, reader = ("margin", "beacon_margin", "answer_margin"), Noting()
    assert checks.with_tables(reader, raw, keep, ()) == checks.with_tables(reader, raw, keep, ("orbit",)) == keep
    assert reader.noted == []
    assert checks.with_tables(reader, raw, keep, ("beacon",)) == ("margin", "answer_margin")
    assert checks.with_tables(reader, raw, ("margin", "answer_margin"), ("beacon",)) == ("margin", "answer_margin")
    assert [(key, value) for key, value, *_ in reader.noted] == [("keep", "beacon_margin")] * (raw is not None)


@pytest.mark.parametrize(
    ("keep", "absent", "refused"),
    [
        (("volume",), (), False),
        (("volume",), ("orbit",), True),
        (("volume",), ("operations",), True),
        (("volume",), ("beacon",), False),
        (("margin",), ("orbit", "operations"), False),
        (("margin", "volume"), ("orbit", "operations"), True),
    ],
)
def test_the_day_needs_both_of_its_tables(keep, absent, refused):
    reader = Noting()
    checks.check_day(reader, keep, absent)
    assert [(key, value) for key, value, *_ in reader.noted] == [("keep", ["volume"])] * refused


# ------------------------------------------------------------------------------------------------------------- limits
REQUIRED = SimpleNamespace(margin_db=3.0, pointing_error_rad=1e-5)


def test_the_mission_requires_a_least_margin_and_a_most_residual_of_what_is_kept():
    margin = Limit("margin", 3.0, None, "requirement.margin")
    faded = Limit("margin_under_fades", 3.0, None, "requirement.margin")
    residual = Limit("residual_quantile", None, 1e-5, "requirement.pointing_error")
    reader = Noting()
    every = ["residual_quantile", "margin", "margin_under_fades", "volume"]
    assert checks.default_limits(reader, every, REQUIRED, {}) == (margin, faded, residual)
    assert checks.default_limits(reader, ["margin", "volume"], REQUIRED, {}) == (margin,)
    assert reader.noted == []
    varied = {"inputs": {"requirement.margin": {}}, "grid": {"requirement.outage": {}}}
    assert checks.default_limits(reader, ["margin", "residual_quantile"], REQUIRED, varied) == (margin, residual)
    assert reader.keys == ["inputs.requirement.margin"]


@pytest.mark.parametrize(
    ("given", "varied", "told"),
    [
        ((), (), ["margin", "residual_quantile"]),
        (("margin",), (), ["residual_quantile"]),
        (("residual_quantile",), (), ["margin"]),
        ((), ("requirement.margin",), ["residual_quantile"]),
        ((), ("requirement.pointing_error",), ["margin"]),
        (("margin",), ("requirement.pointing_error",), []),
    ],
)
def test_each_required_limit_that_is_neither_given_nor_varied_is_told(given, varied, told):
    said = list(checks.unchecked(given, ["margin", "residual_quantile"], REQUIRED, varied))
    assert [each.split()[3].rstrip(",") for each in said] == told
    for each in said:
        assert ('least = "3 dB"' if "margin," in each else 'most = "10 µrad"') in each


@pytest.mark.parametrize(
    ("raw", "least", "most"),
    [({"least": 1}, 1.0, None), ({"most": 2}, None, 2.0), ({"least": 1, "most": 2}, 1.0, 2.0)],
)
def test_a_limit_has_either_side_or_both(raw, least, most):
    assert checks.limit(Noting(), "margin", raw, ["margin"]) == Limit("margin", least, most, "campaign file")


@pytest.mark.parametrize(
    ("name", "raw", "keep", "key"),
    [
        ("margin", {"least": 2, "most": 2}, ["margin"], "limits.margin.most"),
        ("margin", {"least": 2.1, "most": 2}, ["margin"], "limits.margin.most"),
        ("margin", {}, ["margin"], "limits.margin"),
        ("margin", 5, ["margin"], "limits.margin"),
        ("margin", {"least": 2}, ["volume"], "limits.margin"),
        ("margins", {"least": 2}, ["margins"], "limits.margins"),
        (RADIUS, {"least": 2}, [RADIUS], f"limits.{RADIUS}"),
    ],
)
def test_a_limit_that_holds_nothing_is_refused(name, raw, keep, key):
    reader = Noting()
    with pytest.raises(NotedError):
        checks.limit(reader, name, raw, keep)
    assert reader.keys == [key]


@pytest.mark.parametrize(
    ("output", "looped", "keep", "keys"),
    [
        ("margin", False, ["margin"], []),
        ("margin", True, ["volume"], ["precision.output"]),
        (RADIUS, True, ["margin"], []),
        (RADIUS, False, ["margin"], ["precision.output"]),
        ("margins", True, ["margins"], ["precision.output"]),
    ],
)
def test_a_precision_is_of_a_kept_output_or_of_the_radius_of_a_loop(output, looped, keep, keys):
    reader, wanted = Noting(), SimpleNamespace(output=output, half_width=0.25)
    found = checks.half_width(reader, SimpleNamespace(precision=wanted, loop=looped or None), keep)
    assert reader.keys == keys
    assert math.isnan(found) if output == "margins" else found == 0.25
    assert math.isnan(checks.half_width(reader, SimpleNamespace(precision=None, loop=None), keep))


# -------------------------------------------------------------------------------------------------------------- whole
@pytest.mark.parametrize(
    ("tail", "looped", "varying", "present", "keys"),
    [
        (False, False, ["a"], ["keep"], []),
        (True, True, [], [], []),
        (True, False, [], [], ["tail"]),
        (True, True, ["a", "b"], [], ["inputs.a", "inputs.b"]),
        (True, True, [], ["keep", "runs"], ["keep"]),
        (True, True, [], ["limits", "precision", "realisations"], ["limits", "precision", "realisations"]),
        (True, False, ["a"], ["limits"], ["tail", "inputs.a", "limits"]),
    ],
)
def test_a_tail_has_a_loop_that_is_the_same_in_all_rows_and_nothing_beside_it(tail, looped, varying, present, keys):
    reader = Noting()
    table = SimpleNamespace(tail=object() if tail else None, loop=object() if looped else None)
    checks.check_tail(reader, table, varying, dict.fromkeys(present))
    assert reader.keys == keys


@pytest.mark.parametrize(
    ("is_drawn", "looped", "runs", "rows", "most_rows", "key"),
    [
        (False, False, 256, 256, 256, "runs"),
        (True, False, 256, 256, 256, None),
        (False, True, 256, 256, 256, None),
        (False, False, 1, 1, 1, None),
        (False, False, 1, 16, 16, "sampling"),
        (False, False, 1, 1, 9, "precision.at_most"),
        (False, False, 2, 2, 2, "runs"),
    ],
)
def test_more_than_one_row_needs_something_that_makes_rows_differ(is_drawn, looped, runs, rows, most_rows, key):
    for precision in (None, object()):
        reader = Noting()
        table = SimpleNamespace(loop=object() if looped else None, runs=runs, precision=precision)
        checks.check_repeats(reader, table, is_drawn, rows, most_rows)
        assert reader.keys == [key] * (key is not None)
        for _, _, reason, expected, _ in reader.noted:
            assert f"makes {most_rows} rows" in reason
            assert ("and no [precision]" in expected) is (precision is not None)


@pytest.mark.parametrize(
    ("minimise", "key", "nearest"),
    [
        ("margin", None, ""),
        ("-margin", None, ""),
        ("beam.radius", None, ""),
        ("-beam.radius", None, ""),
        ("margn", "optimise.minimise", '"margin"'),
        ("-margn", "optimise.minimise", '"-margin"'),
        ("--margin", "optimise.minimise", '"-margin"'),
        ("zzzzzz", "optimise.minimise", ""),
    ],
)
def test_an_optimisation_minimises_an_output_or_a_variable_or_their_opposite(minimise, key, nearest):
    reader = Noting()
    optimise = SimpleNamespace(minimise=minimise, variables={"beam.radius": 0})
    checks.check_minimise(reader, SimpleNamespace(optimise=optimise))
    assert [(each[0], each[4]) for each in reader.noted] == [(key, nearest)] * (key is not None)
    checks.check_minimise(reader, SimpleNamespace(optimise=None))
    assert len(reader.noted) == (key is not None)


def test_an_optimisation_has_variables():
    reader = Noting()
    checks.check_minimise(reader, SimpleNamespace(optimise=SimpleNamespace(minimise="margin", variables={})))
    assert reader.keys == ["optimise.variables"]


@pytest.mark.parametrize(
    ("rows", "most_rows", "realisations", "keys"),
    [
        (16, 16, 1, []),
        (16, 15, 1, ["precision.at_most"]),
        (16, 2**16, 2**16, []),
        (16, 2**16 + 1, 2**16, ["runs"]),
        (2**17, 2**16 + 1, 2**16, ["precision.at_most", "runs"]),
    ],
)
def test_a_campaign_has_no_more_runs_than_there_are_numbers_for(rows, most_rows, realisations, keys):
    reader = Noting()
    checks.check_size(reader, campaign(precision=SimpleNamespace(at_most=9)), rows, most_rows, realisations)
    assert reader.keys == keys


# -------------------------------------------------------------------------------------------------------------- draws
@pytest.mark.parametrize(
    ("low", "high", "is_log", "key"),
    [
        (1.0, 2.0, False, None),
        (2.0, 2.0, False, "at.high"),
        (2.0, 1.0, False, "at.high"),
        (0.0, 1.0, False, None),
        (-1.0, 1.0, False, None),
        (0.0, 1.0, True, "at.low"),
        (-1.0, 1.0, True, "at.low"),
        (1e-9, 1.0, True, None),
    ],
)
def test_a_range_goes_up_and_has_logarithms_where_it_needs_them(low, high, is_log, key):
    reader = Noting()
    if key is None:
        assert draws.bounds_of(reader, "at", Quantity(""), low, high, is_log) == (low, high)
        return
    with pytest.raises(NotedError):
        draws.bounds_of(reader, "at", Quantity(""), low, high, is_log)
    assert reader.keys == [key]


@pytest.mark.parametrize(
    ("rule", "mean", "share", "where"),
    [
        (Quantity("dB", above=1.0), 0.0, 0.841345, "not above 1 dB"),
        (Quantity("dB", least=1.0), 0.0, 0.841345, "below 1 dB"),
        (Quantity("dB", most=1.0), 0.0, 0.158655, "above 1 dB"),
        (Share(""), 0.0, 0.5 + 0.158655, "not above 0 or not below 1"),
        (Share("", least=0.0), 0.0, 0.5 + 0.158655, "below 0 or not below 1"),  # 0 itself is one
        (Share("", least=0.5), 0.0, 0.691462 + 0.158655, "below 0.5 or not below 1"),
        (Share("", below=2.0), 1.0, 2 * 0.158655, "not above 0 or not below 2"),
        (Quantity("dB", least=-1.0, most=1.0), 0.0, 2 * 0.158655, "below -1 dB or above 1 dB"),
        (Quantity("dB", least=-3.0, most=0.0), 0.0, 0.5 + 0.00135, "above 0 dB"),  # less than a hundredth is not said
        (Quantity("dB"), 0.0, 0.0, ""),
    ],
)
def test_draws_outside_of_a_key_are_counted_on_each_side_of_it(rule, mean, share, where):
    key = SimpleNamespace(numeric=rule, unit=rule.unit)
    found = draws.outside_of(key, Normal(mean, 1.0))
    assert found.share == pytest.approx(share, abs=1e-6)
    assert found.where == where
    assert draws.outside_of(key, Uniform(-9.0, 9.0)).share == 0.0
    assert draws.outside_of(SimpleNamespace(numeric=None, unit=""), Normal(mean, 1.0)).share == 0.0


@pytest.mark.parametrize(
    ("wanted", "drawn", "reason"),
    [
        (Normal(0.0, 1.0), Normal(5.0, 1.0), ""),
        (Normal(0.0, 2.0), Normal(0.0, math.sqrt(2.0) * 0.9999), "is too narrow"),
        (Normal(0.0, 2.0), Normal(0.0, math.sqrt(2.0) * 1.0001), ""),
        (Normal(0.0, 1.0), Uniform(-9.0, 9.0), "never draws far out"),
        (Uniform(1.0, 2.0), Normal(0.0, 1.0), ""),
        (Uniform(1.0, 2.0), Uniform(1.0, 2.0), ""),
        (Uniform(1.0, 2.0), LogUniform(1.0, 2.0), ""),
        (Uniform(1.0, 2.0), Uniform(1.1, 2.0), "does not reach"),
        (LogUniform(1.0, 2.0), Uniform(1.0, 1.9), "does not reach"),
        (Uniform(1.0, 2.0), OneOf((1.0, 2.0), (0.5, 0.5), (1, 2), False), "does not draw every value"),
        (OneOf((1.0, 2.0), (0.5, 0.5), (1, 2), False), Uniform(0.0, 3.0), "does not draw every value"),
        (
            OneOf((1.0, 2.0), (0.5, 0.5), (1, 2), False),
            OneOf((2.0, 3.0, 1.0), (0.1, 0.1, 0.8), (2, 3, 1), False),
            "",
        ),
        (
            OneOf((1.0, 2.0, 3.0), (0.1, 0.1, 0.8), (1, 2, 3), False),
            OneOf((1.0, 2.0), (0.5, 0.5), (1, 2), False),
            "does not draw every value",
        ),
        (OneOf((1.0, 2.0), (0.5, 0.5), ("a", "b"), True), OneOf((1.0, 2.0), (0.1, 0.9), ("a", "b"), True), ""),
        (
            OneOf((1.0, 2.0), (0.5, 0.5), ("a", "b"), True),
            OneOf((1.0, 2.0), (0.5, 0.5), ("b", "a"), True),
            "does not draw every value",
        ),
        (
            OneOf((1.0, 2.0), (0.5, 0.5), ("a", "b"), True),
            OneOf((1.0, 2.0), (0.5, 0.5), (1, 2), False),
            "does not draw every value",
        ),
    ],
)
def test_what_is_drawn_in_place_of_another_reaches_all_of_it(wanted, drawn, reason):
    found = uncovered(wanted, drawn)
    assert found.startswith(reason) if reason else found == ""


def test_densities_end_with_their_range_whose_ends_belong_to_it():
    value = np.array([0.999, 1.0, 2.0, 4.0, 4.001])
    uniform, log_uniform = Uniform(1.0, 4.0), LogUniform(1.0, 4.0)
    inside = -math.log(3.0)
    np.testing.assert_allclose(uniform.log_density(value), [-math.inf, inside, inside, inside, -math.inf])
    own = [-math.log(x * math.log(4.0)) for x in (1.0, 2.0, 4.0)]
    np.testing.assert_allclose(log_uniform.log_density(value), [-math.inf, *own, -math.inf])
    assert log_uniform.at(np.array([0.0, 0.5, 1.0])).tolist() == pytest.approx([1.0, 2.0, 4.0], rel=1e-15)
    assert uniform.at(np.array([0.0, 0.5, 1.0])).tolist() == [1.0, 2.5, 4.0]


def test_a_value_of_a_list_is_drawn_from_the_share_below_it_on():
    one = OneOf((5.0, 3.0, 9.0), (0.25, 0.5, 0.25), (5, 3, 9), False)
    shares = np.array([0.0, 0.2499, 0.25, 0.7499, 0.75, 1.0])
    assert one.at(shares).tolist() == [5.0, 5.0, 3.0, 3.0, 9.0, 9.0]
    density = np.exp(one.log_density(np.array([5.0, 3.0, 9.0, 4.0])))
    np.testing.assert_allclose(density, [0.25, 0.5, 0.25, 0.0])
    assert one.words("dB") == "one of 5 dB, 3 dB, 9 dB, weights 0.25, 0.5, 0.25"
    even = OneOf((1.0, 2.0), (0.5, 0.5), ("near", "far"), True)
    assert even.words("dB") == "one of 1 = near, 2 = far"
    assert OneOf((1.5, 2.0), (0.5, 0.5), (1.5, 2), False).words("") == "one of 1.5, 2"
    assert distributions.quantity(2e-6, "rad") == "2 µrad"


@pytest.mark.parametrize(
    ("share", "words"),
    [(0.12345, "12.3 %"), (0.1, "10 %"), (0.099, "9.9 %"), (0.056789, "5.7 %"), (1.0, "100 %"), (1.234e-5, "0.0012 %")],
)
def test_a_small_share_is_told_with_one_digit_less(share, words):
    assert draws._percent(share) == words


@pytest.mark.parametrize(
    ("value", "number"),
    [(1, True), (-2.5, True), (0, True), (True, False), (False, False), ("1", False), (None, False), (math.nan, False),
     (math.inf, False), (-math.inf, False), ([1], False)],
)  # fmt: skip
def test_a_number_is_plain_and_finite(value, number):
    assert values.is_number(value) is number


# --------------------------------------------------------------------------------------------------------------- keys
@pytest.mark.parametrize(
    ("items", "shares"),
    [
        (["4 urad", "2 urad"], (1.0, 0.5)),
        (["2 urad", "0 urad"], (1.0, 0.0)),
        (["3 urad"], (1.0,)),
        (["0 urad", "0 urad"], ()),
        (["4 urad", "-2 urad"], ()),
        (["4 urad", "2 m"], ()),
        ([], ()),
        ("4 urad", ()),
        (None, ()),
    ],
)
def test_a_list_is_one_number_where_its_items_have_a_share_of_the_largest(items, shares):
    key = keys.Key("jitter.rms", Table, Several(Quantity("rad")))
    found = keys.as_one(key, items)
    assert found.shares == shares
    if not shares:
        assert found is key
        return
    assert (found.numeric, found.unit) == (Quantity("rad"), "rad")
    written = found.written(1e-6)
    assert written == [f"{1e-6 * share!r} rad" for share in shares]
    single = keys.Key("jitter.rms", Table, Quantity("rad"))
    assert keys.as_one(single, items) is single
    whole = keys.Key("a.list", Table, Several(Whole("")))
    assert keys.as_one(whole, items) is whole


def test_a_value_is_written_in_the_way_of_its_key():
    assert keys.Key("a", Table, Whole("")).written(3.0) == 3
    assert isinstance(keys.Key("a", Table, Whole("")).written(3.0), int)
    assert keys.Key("a", Table, Quantity("m")).written(0.1) == "0.1 m"
    assert keys.Key("a", Table, Quantity("")).written(0.1) == 0.1
    assert keys.Key("a", Table, None).written(0.1) == 0.1
    assert keys.Key("a", Table, Several(Quantity("m"))).unit == ""
    word = keys.Key("a", Table, OrWord("m", "km", above=0.0, word="largest"))
    assert word.numeric == Quantity("m", "km", above=0.0)
    assert keys.Key("a", Table, Whole("")).numeric is None and keys.Key("a", Table, None).numeric is None
    assert keys.Key("a", Table, Share("")).numeric == Share("")
    assert keys.Key("a.b.c", Table, None).name == "c"


@pytest.mark.parametrize(
    ("last", "count", "place"),
    [
        ("1", 2, 1), ("2", 2, 2), ("3", 2, None), ("0", 2, None), ("01", 20, None), ("-1", 2, None), ("x", 2, None),
        ("10", 10, 10), ("11", 10, None), ("\u0662", 9, None), ("1", 0, None), ("9" * 5000, 9, None),
    ],
)  # fmt: skip
def test_an_item_has_its_place_from_one_on(last, count, place):
    parts, items = ("table", "list", last), list(range(count))
    if place is not None:
        assert keys._item(parts, items) == place
        return
    with pytest.raises(keys.UnknownKeyError, match=f"is no item of table.list, a list of {count}"):
        keys._item(parts, items)
    with pytest.raises(keys.UnknownKeyError, match="a list of 0"):
        keys._item(parts, "no list")


def test_long_lists_are_shown_by_their_first_and_last_item():
    assert keys.item_keys("a", 3) == ["a.1", "a.2", "a.3"]
    assert keys.item_keys("a", 4) == ["a.1", "a.4"]
    assert keys.item_keys("a", 1) == ["a.1"]


def test_a_value_is_put_at_its_key_and_the_rest_stays():
    data = {"a": {"b": 1, "c": {"d": 2}}, "list": [5, 6, 7], "e": 9}
    assert keys.put(data, "a.c.d", 3) == {"a": {"b": 1, "c": {"d": 3}}, "list": [5, 6, 7], "e": 9}
    assert keys.put(data, "a.new.x", 3)["a"] == {"b": 1, "c": {"d": 2}, "new": {"x": 3}}
    assert keys.put(data, "list.2", 0)["list"] == [5, 0, 7]
    assert keys.put(data, "list", 0)["list"] == 0
    assert keys.put(data, "e.f", 1)["e"] == {"f": 1}
    assert data == {"a": {"b": 1, "c": {"d": 2}}, "list": [5, 6, 7], "e": 9}
    assert [keys.within(data, key) for key in ("a.c.d", "a.x", "e.f", "list")] == [2, None, None, [5, 6, 7]]
    assert keys.flat(data) == {"a.b": 1, "a.c.d": 2, "list": [5, 6, 7], "e": 9}


def test_tables_are_those_that_hold_a_value_and_inner_ones_belong_to_theirs():
    given = {"a": {"b": {"low": 1, "drawn_as": {"low": 2}}}, "c": {}, "d": 4, "e": {"low": 1, "f": {"low": 3}}}
    assert keys.flat_tables(given, ("drawn_as",)) == {
        "a.b": {"low": 1, "drawn_as": {"low": 2}},
        "c": {},
        "d": 4,
        "e": {"low": 1},
        "e.f": {"low": 3},
    }
    assert keys.flat_tables({"a": {"drawn_as": {"x": 1}}}, ()) == {"a.drawn_as": {"x": 1}}


@pytest.mark.parametrize(
    ("key", "touches", "with_cell"),
    [
        ("communication.distance", False, False), ("jitter.rms", False, False), ("requirement.margin", False, False),
        ("fine_pointing.sample_rate", True, True), ("mirror.gain", True, True), ("name", False, False),
        ("answer.transmit_power", False, True), ("terminals.leo_aperture", False, True), ("amplifier.gain", True, True),
    ],
)  # fmt: skip
def test_the_loop_depends_on_its_own_tables_and_on_light_where_it_has_a_quad_cell(key, touches, with_cell):
    whole = load_mission(SHIPPED).mission
    for cell, expected in ((None, touches), (object(), with_cell)):
        fine = SimpleNamespace(optical_sensor=SimpleNamespace(quad_cell=cell))
        assert keys.touches_loop(key, whole.model_copy(update={"fine_pointing": fine})) is expected
    assert keys.touches_loop(key, whole.model_copy(update={"fine_pointing": None})) is touches
    assert keys.touches_loop(key, SimpleNamespace()) is False  # links alone


def test_a_limit_that_nothing_checks_is_told_as_it_was_given():
    required = SimpleNamespace(margin_db=3.0625, pointing_error_rad=12.3456e-6)
    margin, error = checks.unchecked([], ["margin", "residual_quantile"], required, [])
    assert margin.endswith('[limits.margin] with least = "3.0625 dB" checks it')
    assert error.endswith('[limits.residual_quantile] with most = "12.3456 µrad" checks it')


DATA = tomllib.loads(SHIPPED.read_text(encoding="utf-8"))


def noted(check, *given, into=None, **more):
    """The faults that a check notes in a campaign file, in their words, or what it gives where it notes none."""
    document = Document(Path("c.toml"), "campaign file", "")
    found = None
    with contextlib.suppress(NotedError):
        found = check(values.ValueReader(document), *given, **more)
        found = list(found) if isinstance(found, Iterator) else found
    said = "; ".join(f"{f.key} = {f.value} {f.reason}: {f.expected} ({f.nearest})" for f in document.faults)
    return said or repr(found)


def drawn(key, raw, data=DATA):
    """What an input of the shipped mission is drawn from, or the faults of its table."""
    return noted(lambda reader: draws.DrawReader(reader, data, (), frozenset()).draw(key, raw))


def required(**changes):
    given = {"margin_db": 3.125, "pointing_error_rad": 12.5e-6}
    return SimpleNamespace(**given | changes)


def campaign(**tables):
    """The tables of a campaign file, with nothing in them but these."""
    given = {"tail": None, "loop": None, "precision": None, "optimise": None, "runs": 20}
    return SimpleNamespace(**given | tables)


def found_or_refused(key, data=DATA):
    """A key of the shipped mission, or why it is none."""
    try:
        found = keys.find(key, data)
    except keys.UnknownKeyError as error:
        return f"{error.reason}: {error.expected} ({error.nearest})"
    return f"{found.text} {found.name} {found.table.__name__} {found.unit!r} {found.item} {found.numeric is not None}"


ALL_OF_A_CHECK = {
    "a loop without a table": (
        lambda: noted(checks.check_loop, loop(), [SimpleNamespace(fine_pointing=None)]),
        """
        loop = needs a mission with the table [fine_pointing]: a mission with [fine_pointing], which microrad init
        writes, or [loop] removed ()
        """,
    ),
    "the outputs to keep": (
        lambda: noted(checks.kept, ["volume", "margn", 3, "residual_rms", "margin"], campaign()),
        """
        keep = "margn" is no output: one of residual_rms, residual_quantile, residual_largest, beyond_share,
        lost_share, saturated_share, beyond_rate_share, outside_share, margin, margin_under_fades, outage, short,
        data_rate, beacon_margin, answer_margin, volume, contact_time, optical_volume ("margin"); keep = 3 is no
        output: one of residual_rms, residual_quantile, residual_largest, beyond_share, lost_share, saturated_share,
        beyond_rate_share, outside_share, margin, margin_under_fades, outage, short, data_rate, beacon_margin,
        answer_margin, volume, contact_time, optical_volume (); keep = "residual_rms" needs the fine-pointing loop:
        a table [loop], or this output left out ()
        """,
    ),
    "nothing to keep": (
        lambda: noted(checks.kept, "margin", campaign()),
        """keep = "margin" is not a list with something in it: names of outputs: keep = ["margin"] ()""",
    ),
    "outputs of tables that are not there": (
        lambda: noted(
            checks.with_tables,
            0,
            ("beacon_margin", "margin", "margin_under_fades", "optical_volume"),
            ["beacon", "communication.fading", "operations.optical"],
        ),
        """
        keep = "beacon_margin" needs the mission's table [beacon]: a mission with [beacon], or this output left out
        (); keep = "margin_under_fades" needs the mission's table [communication.fading] with a series: a mission
        with [communication.fading] with a series, or this output left out (); keep = "optical_volume" needs the
        mission's table [operations.optical]: a mission with [operations.optical], or this output left out ()
        """,
    ),
    "outputs of tables that nobody asks for": (
        lambda: noted(checks.with_tables, None, ("beacon_margin", "answer_margin", "margin"), ["answer", "operations"]),
        "('beacon_margin', 'margin')",
    ),
    "outputs of a day that is not there": (
        lambda: noted(checks.check_day, ("margin", "volume", "contact_time"), ["beacon", "operations"]),
        """
        keep = ["volume", "contact_time"] needs the mission's tables [orbit] and [operations]: a mission with
        [orbit] and [operations], which microrad init writes, or these outputs left out ()
        """,
    ),
    "a limit that varies in both": (
        lambda: noted(
            checks.default_limits,
            ("residual_quantile", "margin"),
            required(),
            {"grid": {"requirement.margin": 0}, "inputs": {"requirement.pointing_error": 0, "requirement.margin": 0}},
        ),
        """
        grid.requirement.margin = is the limit of margin as well, which is the same in all rows: a table
        [limits.margin] with a value of its own (); inputs.requirement.margin = is the limit of margin as well,
        which is the same in all rows: a table [limits.margin] with a value of its own ();
        inputs.requirement.pointing_error = is the limit of residual_quantile as well, which is the same in all
        rows: a table [limits.residual_quantile] with a value of its own ()
        """,
    ),
    "limits that are the mission's": (
        lambda: noted(
            checks.default_limits,
            ("residual_quantile", "margin_under_fades"),
            required(),
            {"grid": {"requirement.outage": 0}},
        ),
        """
        (Limit(output='margin_under_fades', least=3.125, most=None, source='requirement.margin'),
        Limit(output='residual_quantile', least=None, most=1.25e-05, source='requirement.pointing_error'))
        """,
    ),
    "limits that nothing checks": (
        lambda: "; ".join(
            checks.unchecked(["margin"], ["margin", "margin_under_fades", "residual_quantile"], required(), [])
        ),
        """
        [limits] leaves out margin_under_fades, so that requirement.margin = 3.125 dB is not checked: a table
        [limits.margin_under_fades] with least = "3.125 dB" checks it; [limits] leaves out residual_quantile, so
        that requirement.pointing_error = 12.5 µrad is not checked: a table [limits.residual_quantile] with most =
        "12.5 µrad" checks it
        """,
    ),
    "a limit of no output": (
        lambda: noted(checks.limit, "margn", {"least": "3 dB"}, ["margin"]),
        """
        limits.margn = "margn" is no output: one of residual_rms, residual_quantile, residual_largest, beyond_share,
        lost_share, saturated_share, beyond_rate_share, outside_share, margin, margin_under_fades, outage, short,
        data_rate, beacon_margin, answer_margin, volume, contact_time, optical_volume ("margin")
        """,
    ),
    "a limit of an output that is not kept": (
        lambda: noted(checks.limit, "margin", {"least": "3 dB"}, ["volume"]),
        """
        limits.margin = is a limit of an output that is not kept: "margin" in keep, or this table removed ()
        """,
    ),
    "a limit of nothing": (
        lambda: noted(checks.limit, "margin", {}, ["margin"]),
        "limits.margin = has neither least nor most: [limits.margin] with least or most ()",
    ),
    "a limit of two that cross": (
        lambda: noted(checks.limit, "residual_rms", {"least": "12.5 urad", "most": "12.25 urad"}, ["residual_rms"]),
        """limits.residual_rms.most = "12.25 urad" is not above least: a range that goes up ()""",
    ),
    "a limit of two wrong units": (
        lambda: noted(checks.limit, "data_rate", {"least": "3 dB", "most": 5}, ["data_rate"]),
        """
        limits.data_rate.least = "3 dB" is in dB, another kind of quantity: a data rate with its unit; for example
        least = "5 Mbit/s" (); limits.data_rate.most = 5 is a number without a unit: a data rate with its unit; for
        example most = "5 Mbit/s" ()
        """,
    ),
    "a limit in its own unit": (
        lambda: noted(checks.limit, "data_rate", {"least": "622.08 Mbit/s", "most": "2.5 Gbit/s"}, ["data_rate"]),
        "Limit(output='data_rate', least=622080000.0, most=2500000000.0, source='campaign file')",
    ),
    "a limit of a plain number": (
        lambda: noted(checks.limit, "outage", {"most": 0.0125}, ["outage"]),
        "Limit(output='outage', least=None, most=0.0125, source='campaign file')",
    ),
    "a precision of no output": (
        lambda: noted(checks.half_width, campaign(precision=SimpleNamespace(output="radus", half_width="1 urad")), []),
        """
        precision.output = "radus" is no output: one of residual_rms, residual_quantile, residual_largest,
        beyond_share, lost_share, saturated_share, beyond_rate_share, outside_share, margin, margin_under_fades,
        outage, short, data_rate, beacon_margin, answer_margin, volume, contact_time, optical_volume, radius
        ("radius")
        """,
    ),
    "a precision of the radius without a loop": (
        lambda: noted(checks.half_width, campaign(precision=SimpleNamespace(output="radius", half_width=0.5)), []),
        """
        precision.output = "radius" needs the fine-pointing loop: a table [loop], or another output ();
        precision.half_width = 0.5 is a number without a unit: an angle with its unit; for example half_width =
        "0.05 urad" ()
        """,
    ),
    "a precision of what is not kept": (
        lambda: noted(
            checks.half_width, campaign(precision=SimpleNamespace(output="outage", half_width=0.0)), ["margin"]
        ),
        """
        precision.output = "outage" is not kept: "outage" in keep, or another output (); precision.half_width = 0.0
        is not above 0: a number without quotes, above 0; for example half_width = 0.001 ()
        """,
    ),
    "a precision in gigabytes": (
        lambda: noted(
            checks.half_width, campaign(precision=SimpleNamespace(output="volume", half_width="0.25 GB")), ["volume"]
        ),
        "2000000000.0",
    ),
    "a tail beside what it cannot have": (
        lambda: noted(
            checks.check_tail, campaign(tail=0), ["a.b", "c"], dict.fromkeys(("realisations", "keep", "precision"))
        ),
        """
        tail = needs the fine-pointing loop: a table [loop] (); inputs.a.b = changes the loop, and a table [tail]
        needs the same loop in all rows: the mission's own value, or a grid of values (); inputs.c = changes the
        loop, and a table [tail] needs the same loop in all rows: the mission's own value, or a grid of values ();
        keep = stands beside [tail], whose rows are single errors: one of the two removed (); precision = stands
        beside [tail], whose rows are single errors: one of the two removed (); realisations = stands beside [tail],
        whose rows are single errors: one of the two removed ()
        """,
    ),
    "rows that are all the same": (
        lambda: noted(checks.check_repeats, campaign(runs=20), False, 20, 24),
        """
        runs = makes 24 rows that are all the same: nothing is drawn, and without [loop] there is no noise: runs = 1
        with sampling = "random", one row for each cell; or [inputs.KEY] with a distribution; or [loop] ()
        """,
    ),
    "rows that are all the same up to a precision": (
        lambda: noted(checks.check_repeats, campaign(runs=1, precision=0), False, 16, 48),
        """
        sampling = makes 48 rows that are all the same: nothing is drawn, and without [loop] there is no noise: runs
        = 1 with sampling = "random", and no [precision], one row for each cell; or [inputs.KEY] with a
        distribution; or [loop] ()
        """,
    ),
    "an optimisation of nothing": (
        lambda: noted(checks.check_minimise, campaign(optimise=SimpleNamespace(variables={}, minimise="-magin"))),
        """
        optimise.variables = holds no variable: [optimise.variables.KEY] with low and high (); optimise.minimise =
        "-magin" is neither a variable of the optimisation nor an output: one of residual_rms, residual_quantile,
        residual_largest, beyond_share, lost_share, saturated_share, beyond_rate_share, outside_share, margin,
        margin_under_fades, outage, short, data_rate, beacon_margin, answer_margin, volume, contact_time,
        optical_volume ("-margin")
        """,
    ),
    "an optimisation of what is no name": (
        lambda: noted(
            checks.check_minimise,
            campaign(
                optimise=SimpleNamespace(variables={"terminals.leo_aperture": 0}, minimise="terminals.leo_apertures")
            ),
        ),
        """
        optimise.minimise = "terminals.leo_apertures" is neither a variable of the optimisation nor an output: one
        of terminals.leo_aperture, residual_rms, residual_quantile, residual_largest, beyond_share, lost_share,
        saturated_share, beyond_rate_share, outside_share, margin, margin_under_fades, outage, short, data_rate,
        beacon_margin, answer_margin, volume, contact_time, optical_volume ("terminals.leo_aperture")
        """,
    ),
    "more runs than there are numbers for": (
        lambda: noted(checks.check_size, campaign(precision=SimpleNamespace(at_most=17)), 48, 32, 2**28),
        """
        precision.at_most = 17 is below the 48 rows of the first round: at least 48 (); runs = makes 32 rows of
        268435456 runs each in a cell: at most 2^32 = 4294967296 runs: fewer rows or realisations ()
        """,
    ),
    "an input that is no table": (
        lambda: drawn("communication.transmit_power", "5 W"),
        """
        inputs.communication.transmit_power = "5 W" is no table: [inputs.communication.transmit_power] with
        distribution = "normal" or distribution = "uniform" or distribution = "log-uniform" or distribution =
        "table" or distribution = "identified" ()
        """,
    ),
    "an input without a distribution": (
        lambda: drawn("communication.transmit_power", {"mean": "5 W"}),
        """
        inputs.communication.transmit_power.distribution = is missing: distribution = "normal" or distribution =
        "uniform" or distribution = "log-uniform" or distribution = "table" or distribution = "identified" ()
        """,
    ),
    "an input of another distribution": (
        lambda: drawn("communication.transmit_power", {"distribution": "loguniform"}),
        """
        inputs.communication.transmit_power.distribution = "loguniform" is none of the choices: distribution =
        "normal" or distribution = "uniform" or distribution = "log-uniform" or distribution = "table" or
        distribution = "identified" ("log-uniform")
        """,
    ),
    "an input that is normal": (
        lambda: drawn("communication.transmit_power", {"distribution": "normal", "mean": "5 W", "deviation": "250 mW"}),
        """
        Draw(key='communication.transmit_power', unit='W', distribution=Normal(mean=5.0, deviation=0.25),
        drawn_as=None)
        """,
    ),
    "an input that is normal and falls": (
        lambda: drawn("communication.transmit_power", {"distribution": "normal", "mean": "-5 W", "deviation": "0 W"}),
        """
        inputs.communication.transmit_power.mean = "-5 W" is not above 0 W: a power with its unit, above 0 W, at
        most 1 MW; for example mean = "5 W" (); inputs.communication.transmit_power.deviation = "0 W" is not above 0
        W: a power with its unit, above 0 W; for example deviation = "5 W" ()
        """,
    ),
    "an input that is mostly none": (
        lambda: drawn("communication.transmit_power", {"distribution": "normal", "mean": "1 mW", "deviation": "1 MW"}),
        """
        inputs.communication.transmit_power = has 65.9 % of its draws not above 0 W or above 1 MW: a smaller
        deviation, or distribution = "uniform" or "log-uniform" between bounds ()
        """,
    ),
    "an input that is often none": (
        lambda: drawn("terminals.leo_obscuration", {"distribution": "normal", "mean": 0.94, "deviation": 0.5}),
        """
        inputs.terminals.leo_obscuration = has 52.2 % of its draws below 0 or above 0.95: a smaller deviation, or
        distribution = "uniform" or "log-uniform" between bounds ()
        """,
    ),
    "an input in a range": (
        lambda: drawn("communication.transmit_power", {"distribution": "log-uniform", "low": "2.5 W", "high": "10 W"}),
        """
        Draw(key='communication.transmit_power', unit='W', distribution=LogUniform(low=2.5, high=10.0),
        drawn_as=None)
        """,
    ),
    "an input in a range that falls": (
        lambda: drawn("communication.transmit_power", {"distribution": "uniform", "low": "10 W", "high": "10 W"}),
        """
        inputs.communication.transmit_power.high = "10 W" is not above low ("10 W"): a range that goes up ()
        """,
    ),
    "an input without a logarithm": (
        lambda: drawn(
            "communication.pointing_error", {"distribution": "log-uniform", "low": "0 urad", "high": "10 urad"}
        ),
        """
        inputs.communication.pointing_error.low = "0 urad" is not above 0, so that it has no logarithm: a value
        above 0, or distribution = "uniform" ()
        """,
    ),
    "an input of a list of values": (
        lambda: drawn(
            "conventions.strehl", {"distribution": "table", "values": ["decibel", "ratio"], "weights": [1, 3]}
        ),
        """
        Draw(key='conventions.strehl', unit='', distribution=OneOf(values=(1.0, 2.0), probabilities=(0.25, 0.75),
        written=('decibel', 'ratio'), is_words=True), drawn_as=None)
        """,
    ),
    "an input of numbers with weights": (
        lambda: drawn(
            "communication.transmit_power",
            {"distribution": "table", "values": ["5 W", "2500 mW", "8 W"], "weights": [0.5, 1.25, 0.75]},
        ),
        """
        Draw(key='communication.transmit_power', unit='W', distribution=OneOf(values=(5.0, 2.5, 8.0),
        probabilities=(0.2, 0.5, 0.3), written=('5 W', '2500 mW', '8 W'), is_words=False), drawn_as=None)
        """,
    ),
    "an input of a value twice": (
        lambda: drawn("communication.transmit_power", {"distribution": "table", "values": ["5 W", "5000 mW"]}),
        """
        inputs.communication.transmit_power.values = ["5 W", "5000 mW"] has a value twice: each value once, with its
        weight ()
        """,
    ),
    "an input of values of which two are wrong": (
        lambda: drawn("communication.transmit_power", {"distribution": "table", "values": ["5 m", "5 W", 4]}),
        """
        inputs.communication.transmit_power.values = "5 m" is in "m", another kind of quantity: a power with its
        unit; for example transmit_power = "5 W" (); inputs.communication.transmit_power.values = 4 is a number
        without a unit: a power with its unit; for example transmit_power = "4 W" ()
        """,
    ),
    "an input of too few weights": (
        lambda: drawn(
            "communication.transmit_power", {"distribution": "table", "values": ["5 W", "6 W"], "weights": [1, 0]}
        ),
        """
        inputs.communication.transmit_power.weights = [1, 0] does not give each value its weight: 2 plain numbers
        above 0, one for each value ()
        """,
    ),
    "an input of no values": (
        lambda: drawn("communication.transmit_power", {"distribution": "table", "values": []}),
        """
        inputs.communication.transmit_power.values = [] is not a list with something in it: 1 to 1000 values ()
        """,
    ),
    "an input of a word that is solved for": (
        lambda: drawn("communication.data_rate", {"distribution": "table", "values": ["622.08 Mbit/s", "largest"]}),
        """
        inputs.communication.data_rate.values = ["622.08 Mbit/s", "largest"] has a word that is solved for: values,
        or this word in the mission ()
        """,
    ),
    "an input of words in a range": (
        lambda: drawn("conventions.strehl", {"distribution": "uniform", "low": 1, "high": 2}),
        """
        inputs.conventions.strehl = is not a quantity that takes any value in a range: distribution = "table" with
        its values, or a grid of them ()
        """,
    ),
    "an input of a list": (
        lambda: drawn(
            "scenario.loop_frequencies",
            {"distribution": "uniform", "low": "1 Hz", "high": "2 Hz"},
            {**DATA, "scenario": {"loop_frequencies": ["-1 Hz", "2 Hz"]}},
        ),
        """
        inputs.scenario.loop_frequencies = is a list, whose items are drawn each by its own key:
        scenario.loop_frequencies.1 and scenario.loop_frequencies.2, each with its distribution ()
        """,
    ),
    "an input of a list as one": (
        lambda: drawn("scenario.pid_frequencies", {"distribution": "uniform", "low": "1 Hz", "high": "2 Hz"}),
        """
        Draw(key='scenario.pid_frequencies', unit='Hz', distribution=Uniform(low=1.0, high=2.0), drawn_as=None)
        """,
    ),
    "an input that is identified": (
        lambda: drawn("communication.transmit_power", {"distribution": "identified"}),
        """
        inputs.communication.transmit_power = does not go together with its distribution: [inputs.mirror] with
        distribution = "identified", or the key of a single value ()
        """,
    ),
    "a mirror that is not": (
        lambda: drawn("mirror", {"distribution": "normal", "mean": 1, "deviation": 1}),
        """
        inputs.mirror = does not go together with its distribution: [inputs.mirror] with distribution =
        "identified", or the key of a single value ()
        """,
    ),
    "an input that is drawn as another": (
        lambda: drawn(
            "communication.transmit_power",
            {
                "distribution": "normal",
                "mean": "5 W",
                "deviation": "250 mW",
                "drawn_as": {"distribution": "normal", "mean": "4.5 W", "deviation": "0.5 W"},
            },
        ),
        """
        Draw(key='communication.transmit_power', unit='W', distribution=Normal(mean=5.0, deviation=0.25),
        drawn_as=Normal(mean=4.5, deviation=0.5))
        """,
    ),
    "an input that is drawn as a narrow one": (
        lambda: drawn(
            "communication.transmit_power",
            {
                "distribution": "normal",
                "mean": "5 W",
                "deviation": "250 mW",
                "drawn_as": {"distribution": "normal", "mean": "4.5 W", "deviation": "0.125 W"},
            },
        ),
        """
        inputs.communication.transmit_power.drawn_as = is too narrow: its weights would have no finite variance: a
        distribution that reaches as far as the input's own ()
        """,
    ),
    "an input that is drawn as one that is drawn": (
        lambda: drawn(
            "communication.transmit_power",
            {
                "distribution": "uniform",
                "low": "5 W",
                "high": "6 W",
                "drawn_as": {"distribution": "uniform", "low": "5 W", "high": "6 W", "drawn_as": 0},
            },
        ),
        """
        inputs.communication.transmit_power.drawn_as = is no distribution that an input can be drawn as: a normal
        one, for example ()
        """,
    ),
    "warnings of inputs": (
        lambda: "; ".join(
            draws.failing(
                (
                    Draw("communication.pointing_error", "rad", Normal(1e-6, 1e-6), None),
                    Draw("communication.transmit_power", "W", Uniform(1.0, 2.0), Normal(2.0, 0.75)),
                    Draw("mirror", "", None, None),
                    Draw("requirement.outage", "", Normal(0.5, 0.125), None),
                ),
                DATA,
                200,
            )
        ),
        """
        15.9 % of the draws of communication.pointing_error are below 0 rad: those rows will fail, and the results
        will be those of the others; a smaller deviation, or distribution = "uniform" or "log-uniform" between
        bounds avoids it; 0.38 % of the draws of communication.transmit_power are not above 0 W: those rows will
        fail, and the results will be those of the others; a smaller deviation, or distribution = "uniform" or
        "log-uniform" between bounds avoids it; 0.0063 % of the draws of requirement.outage are not above 0 or not
        below 1: those rows will fail, and the results will be those of the others; a smaller deviation, or
        distribution = "uniform" or "log-uniform" between bounds avoids it
        """,
    ),
    "inputs in words": (
        lambda: [
            (t.key, t.unit, t.distribution)
            for t in draws.input_texts(
                (
                    Draw("a", "W", Normal(2.5, 0.125), Uniform(1.0, 4.0)),
                    Draw("b", "", OneOf((1.0, 2.0), (0.25, 0.75), ("x", "y"), True), None),
                    Draw("c", "rad", LogUniform(1e-6, 2.5e-5), None),
                    Draw("d", "bit/s", OneOf((622.08e6, 1e9), (0.5, 0.5), ("622.08 Mbit/s", "1 Gbit/s"), False), None),
                ),
                (),
            )
        ],
        """
        [('a', 'W', 'normal, mean 2.5 W, deviation 125 mW; drawn as uniform, 1 W to 4 W and weighted'), ('b', '',
        'one of 1 = x, 2 = y, weights 0.25, 0.75'), ('c', 'rad', 'log-uniform, 1 µrad to 25 µrad'), ('d', 'bit/s',
        'one of 622.1 Mbit/s, 1 Gbit/s')]
        """,
    ),
    "variables": (
        lambda: [
            noted(
                lambda reader, key, low, high: draws.variable(reader, key, SimpleNamespace(low=low, high=high), DATA),
                *each,
            )
            for each in (
                ("terminals.leo_aperture", "2.5 cm", "100 mm"),
                ("fine_pointing.runs", 1, 2),
                ("terminals.leo_apertur", "1 m", "2 m"),
                ("communication.data_rate", "622.08 Mbit/s", "1 Gbit/s"),
            )
        ],
        """
        ["Variable(key='terminals.leo_aperture', unit='m', low=0.025, high=0.1)",
        'optimise.variables.fine_pointing.runs = is not a quantity that takes any value in a range: the key of a
        quantity ()', 'optimise.variables.terminals.leo_apertur = is no key of [terminals]: one of leo_aperture,
        geo_aperture, leo_obscuration, geo_obscuration, leo_name, geo_name (terminals.leo_aperture)',
        "Variable(key='communication.data_rate', unit='bit/s', low=622080000.0, high=1000000000.0)"]
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_CHECK)
def test_what_a_check_notes_is_told_in_full(what):
    call, words = ALL_OF_A_CHECK[what]
    assert one_line(str(call())) == one_line(words)


KEYS = {
    "the key communication.transmit_power": (
        lambda: found_or_refused("communication.transmit_power"),
        "communication.transmit_power transmit_power Communication 'W' None True",
    ),
    "the key pointing.lines.misalignment.error": (
        lambda: found_or_refused("pointing.lines.misalignment.error"),
        "pointing.lines.misalignment.error error PointingLine 'rad' None True",
    ),
    "the key pointing.lines": (
        lambda: found_or_refused("pointing.lines"),
        """
        is a group of named tables and no value: one of body_pointing, orbit_knowledge, misalignment ()
        """,
    ),
    "the key pointing.lines.misaligment.error": (
        lambda: found_or_refused("pointing.lines.misaligment.error"),
        """
        is no key of [pointing.lines]: one of body_pointing, orbit_knowledge, misalignment
        (pointing.lines.misalignment.error)
        """,
    ),
    "the key scenario.pid_frequencies.2": (
        lambda: found_or_refused("scenario.pid_frequencies.2"),
        "scenario.pid_frequencies.2 2 Scenario 'Hz' 2 True",
    ),
    "the key scenario.pid_frequencies.3": (
        lambda: found_or_refused("scenario.pid_frequencies.3"),
        """
        is no item of scenario.pid_frequencies, a list of 2: scenario.pid_frequencies.1 or
        scenario.pid_frequencies.2 ()
        """,
    ),
    "the key scenario.pid_frequencies.02": (
        lambda: found_or_refused("scenario.pid_frequencies.02"),
        """
        is no item of scenario.pid_frequencies, a list of 2: scenario.pid_frequencies.1 or
        scenario.pid_frequencies.2 ()
        """,
    ),
    "the key communication": (
        lambda: found_or_refused("communication"),
        """
        is a table and no value: one of its keys transmit_power, wavelength, strehl, wavefront_error,
        pointing_error, distance, transmit_optics_loss, receive_optics_loss, data_rate, tracking_split_loss,
        implementation_loss, receiver_sensitivity, receiver, code_word, beam, coupling, fading ()
        """,
    ),
    "the key comunication.transmit_power": (
        lambda: found_or_refused("comunication.transmit_power"),
        """
        is no key of the mission: one of name, pointing, terminals, conventions, beacon, answer, communication,
        requirement, channel, jitter, point_ahead, error_budget, acquisition, orbit, operations, constellation,
        mirror, amplifier, control, scenario, fine_pointing (communication.transmit_power)
        """,
    ),
    "the key communication.transmit_power.x": (
        lambda: found_or_refused("communication.transmit_power.x"),
        "goes on behind communication.transmit_power, which holds a value: the key without it ()",
    ),
    "the key fine_pointing.runs": (
        lambda: found_or_refused("fine_pointing.runs"),
        "fine_pointing.runs runs FinePointing '' None False",
    ),
    "the key orbit.leo.inclination": (
        lambda: found_or_refused("orbit.leo.inclination"),
        "orbit.leo.inclination inclination OrbitTable 'rad' None True",
    ),
    "the key terminals.leo_name": (
        lambda: found_or_refused("terminals.leo_name"),
        "terminals.leo_name leo_name Terminals '' None False",
    ),
    "the key requirement.outage": (
        lambda: found_or_refused("requirement.outage"),
        "requirement.outage outage Requirement '' None True",
    ),
    "the key operations.optical.stations.a.availability.13": (
        lambda: found_or_refused("operations.optical.stations.a.availability.13"),
        "is no key of [operations.optical.stations]: a table that the mission has ()",
    ),
    "the key constellation.relays": (
        lambda: found_or_refused("constellation.relays"),
        "is a group of named tables and no value: one of east, west ()",
    ),
    "the key zzz": (
        lambda: found_or_refused("zzz"),
        """
        is no key of the mission: one of name, pointing, terminals, conventions, beacon, answer, communication,
        requirement, channel, jitter, point_ahead, error_budget, acquisition, orbit, operations, constellation,
        mirror, amplifier, control, scenario, fine_pointing ()
        """,
    ),
}


@pytest.mark.parametrize("what", KEYS)
def test_a_key_is_found_with_its_table_and_unit_or_refused_in_full(what):
    call, words = KEYS[what]
    assert one_line(str(call())) == one_line(words)


@pytest.mark.parametrize(
    ("key", "distribution", "files"),
    [
        ("fine_pointing.vibration.file", OneOf((1.0, 2.0), (0.5, 0.5), ("a.csv", "b.csv"), True), ("a.csv", "b.csv")),
        ("fine_pointing.mirror_file", OneOf((1.0,), (1.0,), ("m.toml",), True), ("m.toml",)),
        ("communication.fading.series", OneOf((1.0,), (1.0,), ("f.csv",), True), ("f.csv",)),
        ("conventions.strehl", OneOf((1.0,), (1.0,), ("ratio",), True), ()),
        ("fine_pointing.profile", OneOf((1.0,), (1.0,), ("x",), True), ()),
        ("communication.fading.series", None, ()),
        ("communication.fading.series", Normal(1.0, 0.5), ()),
    ],
)
def test_the_files_of_an_input_are_those_that_its_list_names(key, distribution, files):
    assert Draw(key, "", distribution, None).files == files


@pytest.mark.parametrize(
    ("low", "high", "is_log", "quarter"),
    [
        (2.0, 20.0, True, 2.0 * 10.0**0.25),
        (2.0, 19.99, False, 2.0 + 17.99 / 4.0),
        (-20.0, -2.0, False, -15.5),
        (0.0, 8.0, False, 2.0),
    ],
)
def test_a_variable_goes_evenly_or_by_ratios_and_never_beyond_its_bounds(low, high, is_log, quarter):
    variable = Variable("a", "m", low, high)
    assert (variable.log, variable.at(0.25)) == (is_log, pytest.approx(quarter, rel=1e-12))
    assert (variable.at(0.0), variable.at(1.0), variable.at(1.0 + 1e-9), variable.at(-0.1)) == (low, high, high, low)


def test_a_cell_has_its_values_in_words_and_a_column_for_each_direction(monkeypatch):
    file = SimpleNamespace(mission=SimpleNamespace(mirror="no whole mission"))
    cell = Cell({"a.b": "5 cm", "mirror": "m.toml"}, {}, file)
    assert (cell.label, cell.directions, cell.mirror) == ("a.b = 5 cm, mirror = m.toml", (), None)
    assert Cell({}, {}, file).label == ""
    monkeypatch.setattr(definition_records.coupled, "directions", lambda mirror: 3)
    several = Cell({}, {}, file, several_axes=object())
    assert several.directions == ("mirror.1", "mirror.2", "mirror.3")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"),
        (False, "false"),
        ("5 cm", "5 cm"),
        (622.08, "622.08"),
        (7, "7"),
        (["1 Hz", ["a", True], 2.5], "[1 Hz, [a, true], 2.5]"),
        ([], "[]"),
    ],
)
def test_a_value_of_a_campaign_is_told_as_its_file_has_it_without_quotes(value, text):
    assert values.text_of(value) == text


@pytest.mark.parametrize(
    ("output", "expected"),
    [
        ("radius", 'an angle with its unit, above 0 rad; for example half_width = "0.05 urad"'),
        ("data_rate", 'a data rate with its unit, above 0 bit/s; for example half_width = "0.05 Mbit/s"'),
        ("volume", 'a volume of data with its unit, above 0 bit; for example half_width = "0.05 GB"'),
        ("outage", "a number without quotes, above 0; for example half_width = 0.001"),
        ("none", 'a half width in the unit of the output; for example half_width = "0.05 dB"'),
        (3, 'a half width in the unit of the output; for example half_width = "0.05 dB"'),
    ],
)
def test_a_half_width_that_is_missing_is_told_in_the_unit_of_its_output(output, expected):
    document = Document(Path("c.toml"), "campaign file", "")
    reader = values.ValueReader(document)
    reader.fault("precision.half_width", None, "is missing", "as it was")
    reader.fault("precision.half_width", None, "is wrong", "as it was")
    reader.fault("precision.quantile", None, "is missing", "as it was")
    checks.tell_half_width(reader, output)
    assert [fault.expected for fault in document.faults[:3]] == [expected, "as it was", "as it was"]
    assert [fault.reason for fault in document.faults[3:]] == ["is no output"] * (output == "none")


def test_of_several_numbers_each_that_is_wrong_is_noted_by_its_own_name():
    document = Document(Path("c.toml"), "campaign file", "")
    rule = Quantity("m", "cm", above=0.0)
    with pytest.raises(NotedError):
        values.ValueReader(document).numbers("a.b", {"low": (rule, "-5 cm"), "mid": (rule, "1 m"), "high": (rule, 7)})
    assert [(f.key, f.value, f.reason, f.expected) for f in document.faults] == [
        ("a.b.low", '"-5 cm"', "is not above 0 m", 'a length with its unit, above 0 m; for example low = "5 cm"'),
        ("a.b.high", "7", "is a number without a unit", 'a length with its unit; for example high = "7 cm"'),
    ]
    found = values.ValueReader(document).numbers("a.b", {"low": (rule, "5 cm"), "high": (rule, "1.25 m")})
    assert found == (0.05, 1.25)


def test_the_second_mission_of_a_grid_is_checked_for_its_loop_in_full(mission):
    told = []
    for table, fine in (
        ({"controller": "LQR"}, {}),
        ({"axes": "one"}, {"mirror_file": "a.toml"}),
        ({"mirror": Variant.COMPARISON}, {"mirror_file": "a.toml"}),
        ({"mirror": Variant.COMPARISON}, {"comparison": None}),
        ({"duration_s": 0.25, "settle_s": 0.375}, {}),
        ({}, {"duration_s": 0.0625}),
    ):
        told.append(noted(checks.check_loop, loop(**table), [mission(**fine)]))
    of_axes = "is for a mirror on each axis, and fine_pointing.mirror_file names one of several axes"
    assert told == [
        'loop.controller = "LQR" is no controller of the fine-pointing study: "PI" or "LQG" ("LQG")',
        f'loop.axes = "one" {of_axes}: axes = "both" ()',
        f'loop.mirror = "comparison" {of_axes}: mirror = "given" ()',
        'loop.mirror = "comparison" needs a comparison model, which the mirror "A" has not: mirror = "given" ()',
        'loop.duration =  leaves 250 ms, all of it settling (375 ms): duration = "1.5 s" would do ()',
        'loop.duration =  leaves 62.5 ms, all of it settling (500 ms): duration = "2 s" would do ()',
    ]


def test_links_alone_have_no_mirror_to_identify_and_two_cells_are_looked_at():
    cells = tuple(Cell({}, {}, SimpleNamespace(mission=m)) for m in (load_mission(SHIPPED).mission, SimpleNamespace()))
    told = []
    for of in (cells, cells[1:]):
        reader_of = lambda reader, of=of: draws.DrawReader(reader, DATA, of, frozenset())  # noqa: E731
        told.append(noted(lambda reader, of=reader_of: of(reader).draw("mirror", {"distribution": "identified"})))
    name, expected = (
        cells[0].mirror.name,
        '[set] with mirror = "FILE", or [grid] with mirror = ["FILE"]: a mirror file as microrad identify writes it, '
        "seen from the campaign file ()",
    )
    assert told == [
        f'inputs.mirror =  is to be identified, but the mirror "{name}" has no table uncertainty: {expected}',
        f"inputs.mirror =  is to be identified, but the mission has no mirror, only its links: {expected}",
    ]
    assert draws.DrawReader(None, DATA, (), frozenset())._shares("", None, 4) == (0.25,) * 4


def test_drawn_switches_and_lists_are_told_as_the_file_has_them():
    even = OneOf((1.0, 2.0), (0.5, 0.5), (False, ["1 urad", "2 urad"]), True)
    assert even.words("") == "one of 1 = false, 2 = [1 urad, 2 urad]"


@pytest.mark.parametrize(
    ("least", "most", "said"),
    [
        (
            "12.5 urad",
            "12.5 urad",
            """limits.residual_rms.most = "12.5 urad" is not above least: a range that goes up ()""",
        ),
        (
            "12.5 urad",
            "0.0125 mrad",
            """limits.residual_rms.most = "0.0125 mrad" is not above least: a range that goes""",
        ),
        ("12.5 urad", "12.6 urad", "Limit("),
    ],
)
def test_a_limit_whose_ends_are_the_same_is_no_range(least, most, said):
    found = noted(checks.limit, "residual_rms", {"least": least, "most": most}, ["residual_rms"])
    assert found.startswith(said)


@pytest.mark.parametrize("weights", [[1], [1, 2, 3], [], [1, -2], [0, 1], [1, True], [1, "2"], 3, "1, 2"])
def test_weights_are_as_many_as_the_values_and_each_above_nothing(weights):
    key, listed = "communication.transmit_power", {"distribution": "table", "values": ["5 W", "6 W"]}
    found = drawn(key, {**listed, "weights": weights})
    assert found.startswith(f"inputs.{key}.weights = ")
    assert " does not give each value its weight: 2 plain numbers above 0, one for each value ()" in found
    assert "inputs." not in drawn(key, {**listed, "weights": [1, 3]})
