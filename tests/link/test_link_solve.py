"""What a key may be at the required margin: against formulas, at both ends of each interval, and in words."""

import csv
import io
import json
import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

import budgets
from link_files import GAUSSIAN, PATTERN, data_with, link_file, received_with, written
from microrad import link
from microrad.core.units import format_quantity
from microrad.link import study as link_study
from microrad.link import variation
from microrad.link.pointing import outage as link_performance
from microrad.mission.model import Source

NO_BEAMS = dict.fromkeys(("beacon", "answer", "acquisition"))
JITTER = {"jitter": {"bias": ["0 urad", "0 urad"], "rms": ["3 urad", "3 urad"], "bandwidth": "50 Hz"}}
UNLIKE = {"jitter": {"bias": ["1 urad", "0 urad"], "rms": ["3 urad", "2 urad"], "bandwidth": "50 Hz"}}


def solved(folder, key, *changes):
    return link_study.solve_key(link_file(folder, *changes), key)


def only(solution):
    (interval,) = solution.solved.intervals
    return interval


@pytest.mark.promise("link-6")
def test_power_rate_and_distance_are_those_of_the_formulas(tmp_path):
    margin = link_performance.margin_db(link.of(link_file(tmp_path).mission))
    spare = 10.0 ** ((margin - 3.0) / 10.0)
    power = only(solved(tmp_path, "communication.transmit_power"))
    assert power.low == pytest.approx(5.0 / spare, rel=1e-9) and (power.low_open, power.high_open) == (False, True)
    rate = only(solved(tmp_path, "communication.data_rate"))
    assert rate.high == pytest.approx(300e6 * spare, rel=1e-9) and (rate.low_open, rate.high_open) == (True, False)
    assert only(solved(tmp_path, "communication.distance")).high == pytest.approx(42e6 * math.sqrt(spare), rel=1e-9)


@pytest.mark.promise("link-6")
def test_a_loss_in_decibels_is_what_is_to_spare(tmp_path):
    less = {"communication.data_rate": "100 Mbit/s"}
    margin = link_performance.margin_db(link.of(link_file(tmp_path, less).mission))
    solution = solved(tmp_path, "communication.transmit_optics_loss", less)
    assert solution.solved.searched == (0.0, 60.0)
    loss = only(solution)
    assert loss.low_open and loss.high == pytest.approx(margin - 3.0, abs=1e-9)


@pytest.mark.promise("link-6")
def test_an_aperture_has_a_least_and_a_most(tmp_path):
    """Its gain grows by the square, and the pointing loss of its narrower beam by the square in decibels."""
    solution = solved(tmp_path, "terminals.leo_aperture")
    found = only(solution)
    assert not (found.low_open or found.high_open)
    half = 2.0 * 1.55e-6 / math.pi
    margin = link_performance.margin_db(link.of(link_file(tmp_path).mission))
    for d in (found.low, found.high):
        gain, lost = 20.0 * math.log10(d / 0.05), 20.0 * math.log10(math.e) * (1e-5 / half) ** 2 * (d**2 - 0.05**2)
        assert margin + gain - lost == pytest.approx(3.0, abs=1e-9)
    assert found.low < solution.solved.best < found.high and solution.solved.best_db > 3.5
    assert solution.value == found.low == solution.file.mission.terminals.leo_aperture_m
    assert solution.file.sources["terminals.leo_aperture"].comment == "solved for: 3 dB of communication"


@pytest.mark.promise("link-6")
def test_a_jitter_of_equal_axes_is_that_of_rayleigh(tmp_path):
    file = link_file(tmp_path, NO_BEAMS, JITTER)
    m = file.mission
    on_axis = budgets.communication(m, {}, pointing_error_rad=0.0).margin_db
    half = 2.0 * 1.55e-6 / (math.pi * 0.05)
    allowed = half * math.sqrt((on_axis - 3.0) / (20.0 * math.log10(math.e)))
    found = only(link_study.solve_key(file, "jitter.rms"))
    assert found.high == pytest.approx(allowed / math.sqrt(-2.0 * math.log(m.requirement.outage)), rel=1e-6)
    assert link_study.run_link_study(
        link_study.solve_key(file, "jitter.rms").file
    ).communication.margin_db == pytest.approx(3.0)


@pytest.mark.promise("link-6")
@pytest.mark.promise("campaigns-9")
def test_a_key_of_two_axes_keeps_their_proportion_and_an_axis_stands_by_itself(tmp_path):
    both = solved(tmp_path, "jitter.rms", NO_BEAMS, UNLIKE)
    x, y = both.file.mission.jitter.rms_rad
    assert y == pytest.approx(x * 2.0 / 3.0, rel=1e-12) and x == both.value == only(both).high
    one = solved(tmp_path, "jitter.rms.2", NO_BEAMS, UNLIKE)
    assert one.file.mission.jitter.rms_rad == (3e-6, only(one).high)


@pytest.mark.promise("link-6")
def test_a_beam_is_looked_for_at_its_own_margin_and_above_diffraction(tmp_path):
    solution = solved(tmp_path, "answer.divergence")
    found = only(solution)
    assert (solution.of, solution.required_db) == ("answer", 0.0)
    m = solution.file.mission
    assert budgets.answer(m.with_value("answer.divergence_rad", found.high), {}).margin_db == pytest.approx(
        0.0, abs=1e-9
    )
    assert variation.divergence_possible("answer")(m) and not variation.divergence_possible("answer")(
        m.with_value("answer.divergence_rad", found.low * 0.999)
    )


@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-2", "link-6")
@pytest.mark.parametrize(
    ("changes", "every"),
    [
        pytest.param({}, 1, marks=pytest.mark.endurance, id="gain"),
        pytest.param(PATTERN, 3, id="pattern"),
        pytest.param(PATTERN, 1, marks=pytest.mark.endurance, id="pattern, each of them"),
        pytest.param(received_with("preamplified dpsk"), 1, marks=pytest.mark.endurance, id="receiver"),
    ],
)
def test_every_key_has_its_margin_inside_and_not_beyond_its_ends(tmp_path, changes, every):
    file = link_file(tmp_path, changes, UNLIKE, {"communication.data_rate": "100 Mbit/s"})
    m = file.mission
    tables = ("terminals", "communication", "communication.receiver", "communication.beam", "jitter")
    keys = [each.shown for table in tables for each in variation.inputs(m, table) if each.value != 0.0]
    assert len(keys) > 10
    for key in keys[::every]:
        try:
            solution = link_study.solve_key(file, key)
        except ValueError as error:
            assert "moves this margin by nothing" in str(error), key
            continue
        found = tuple(each for table in tables for each in variation.inputs(m, table) if each.shown == key)
        for interval in solution.solved.intervals:
            for end, outside, is_open in (
                (interval.low, 1.0 - 1e-6, interval.low_open),
                (interval.high, 1.0 + 1e-6, interval.high_open),
            ):
                there = variation.moved(m, found, end)
                assert link_performance.margin_db(link.of(there)) >= 3.0, key
                beyond = variation.moved(m, found, end * outside)
                if not is_open and beyond is not None and link.beam_passes(beyond):
                    assert variation.margin_or_none(link.of(beyond), link_performance.margin_db) < 3.0, key


@pytest.mark.promise("link-6")
def test_what_no_value_leaves_is_said_with_the_most(call, tmp_path):
    far = written(tmp_path, data_with(NO_BEAMS | {"communication.data_rate": "100 Gbit/s"}))
    result = call("budget", far, "--solve", "terminals.leo_aperture")
    said = " ".join(result.out.partition("\n\n")[0].split())
    assert said.startswith(
        "No value of terminals.leo_aperture from 50 nm to 100 m leaves the required 3 dB of communication: the most is "
        "\u221221."
    )
    assert said.endswith("dB at 66.68 mm. No other was looked at.")
    data = json.loads(call("budget", far, "--solve", "terminals.leo_aperture", "--json").out)["solved"]
    assert (data["intervals"], data["value"], result.code) == ([], 0.05, 1)


@pytest.mark.promise("link-2", "link-6")
def test_the_solution_stands_first_and_the_budgets_have_it(call, tmp_path):
    path = written(tmp_path, data_with(NO_BEAMS))
    result = call("budget", path, "--solve", "terminals.leo_aperture")
    first, second, *_ = result.out.split("\n\n")
    assert " ".join(first.split()).startswith(
        "terminals.leo_aperture leaves the required 3 dB of communication from 50 mm to 91.66 mm, most (+3.76 dB) near "
    )
    assert " ".join(first.split()).endswith("Looked at: 50 nm to 100 m. The budgets below have 50 mm.")
    assert "communication +3.00 dB" in second
    data = json.loads(call("budget", path, "--solve", "communication.transmit_power", "--json").out)
    (low, high), *_ = data["solved"]["intervals"]
    assert high is None and low == data["solved"]["value"] == pytest.approx(5.0, rel=1e-3)
    assert data["solved"]["searched"] == pytest.approx([5e-6, 1e6], rel=1e-9)  # the rule ends before six decades do
    assert data["budgets"][0]["margin_db"] == pytest.approx(3.0, abs=1e-9)


@pytest.mark.promise("link-6")
def test_what_holds_as_far_as_was_looked_says_how_far(call, tmp_path):
    """It said "at any value", and the margin ends at four times the largest that was looked at."""
    near = written(tmp_path, data_with(NO_BEAMS | {"communication.distance": "10 m"}))
    said = " ".join(call("budget", near, "--solve", "communication.distance").out.partition("\n\n")[0].split())
    assert said == (
        "communication.distance leaves the required 3 dB of communication wherever it was looked at. "
        "Looked at: 10 \u00b5m to 10000 km. The budgets below have 10000 km."
    )


@pytest.mark.promise("link-6")
def test_the_table_and_the_page_say_what_was_solved_for(call, tmp_path):
    path = written(tmp_path, data_with(NO_BEAMS))
    words = ("budget", path, "--solve", "communication.transmit_power")
    solved = json.loads(call(*words, "--json").out)["solved"]
    rows = [row for row in csv.DictReader(io.StringIO(call(*words, "--csv").out)) if row["budget"] == "Solved"]
    found = {row["line"].removeprefix("communication.transmit_power "): row for row in rows}
    assert float(found["from"]["value"]) == float(found["in the budgets below"]["value"]) == solved["value"]
    assert found["from"]["basis"] == "leaves the required 3 dB of communication"
    assert found["to"]["basis"] == "leaves the required 3 dB of communication, as far as was looked"
    assert [float(found[f"looked at {end}"]["value"]) for end in ("from", "to")] == solved["searched"]
    assert {row["unit"] for row in rows} == {"W", "dB"}
    page = call(*words, "--html").out
    said = " ".join(call(*words).out.partition("\n\n")[0].split())
    assert said.startswith("communication.transmit_power leaves the required 3 dB of communication from ")
    assert said in page
    assert "Solved" not in call("budget", path, "--csv").out
    assert "Looked at" not in call("budget", path, "--html").out


def test_a_key_that_moves_nothing_is_refused(refused, tmp_path):
    path = written(tmp_path, data_with(NO_BEAMS | UNLIKE))
    assert "communication.pointing_error moves this margin by nothing" in refused(
        "budget", path, "--solve", "communication.pointing_error"
    )


def test_a_wider_beam_in_the_same_aperture_has_its_own_best(tmp_path):
    beam = {"conventions.pointing_loss": "pattern", "communication.beam": {**GAUSSIAN, "radius": "8 mm"}}
    solution = solved(tmp_path, "communication.beam.radius", NO_BEAMS, beam, {"communication.data_rate": "100 Mbit/s"})
    assert 8e-3 < solution.solved.best < 0.05


def test_a_margin_that_no_value_has_is_left_by_none(tmp_path):
    m = link_file(tmp_path).mission
    (distance,) = (each for each in variation.inputs(m, "communication") if each.shown == "communication.distance")
    solved = variation.solve(m, (distance,), "m", lambda m: 0.0, 0.0, lambda m: False)
    assert (solved.intervals, solved.best_db) == ((), -math.inf)


def numbered(value, above=-math.inf, below=math.inf, key="a.key"):
    """An input whose table is the number itself, allowed between two bounds."""
    rule = SimpleNamespace(out_of_bounds=lambda number: "" if above <= number <= below else "is beyond")
    return SimpleNamespace(key=key, shown=key, value=value, rule=rule, moved=lambda tables, number: number)


def solve(margin_db, value=1.0, unit="dB", required_db=0.0, possible=lambda _: True, **bounds):
    return variation.solve(value, (numbered(value, **bounds),), unit, margin_db, required_db, possible)


def test_a_margin_that_is_just_left_at_one_value_is_left_there():
    found = solve(lambda x: -abs(x - 1.0))
    (only_one,) = found.intervals
    assert (only_one.low, only_one.high) == (pytest.approx(1.0, abs=1e-9), pytest.approx(1.0, abs=1e-9))
    assert (only_one.low_open, only_one.high_open) == (False, False)
    assert (found.best, found.best_db) == (1.0, 0.0)


def test_decibels_are_looked_for_60_db_up_and_down():
    found = solve(lambda x: 1000.0 + x)
    (whole,) = found.intervals
    assert (whole.low, whole.high, whole.low_open, whole.high_open) == (-59.0, 61.0, True, True)
    assert (found.searched, found.best) == ((-59.0, 61.0), 61.0)


def test_what_is_no_decibel_is_looked_for_six_decades_up_and_down():
    found = solve(lambda x: 1000.0 + x, value=2.0, unit="m")
    assert found.searched == pytest.approx((2e-6, 2e6))
    with pytest.raises(ValueError, match=r"a\.key is 0, which no factor moves"):
        solve(lambda x: x, value=0.0, unit="m")
    assert solve(lambda x: x, value=0.0, unit="dB").searched == (-60.0, 60.0)


def test_a_bound_of_the_rule_leaves_an_end_open_and_a_margin_does_not():
    found = solve(lambda x: x + 3.0, below=5.0)
    (kept,) = found.intervals
    assert (kept.low, kept.low_open) == (pytest.approx(-3.0), False)
    assert (kept.high, kept.high_open) == (pytest.approx(5.0, abs=1e-6), True)
    assert found.searched == (-59.0, pytest.approx(5.0))
    lower = solve(lambda x: 3.0 - x, above=-2.0)
    (kept,) = lower.intervals
    assert (kept.low, kept.low_open) == (pytest.approx(-2.0, abs=1e-6), True)
    assert (kept.high, kept.high_open) == (pytest.approx(3.0), False)
    assert lower.searched == (pytest.approx(-2.0), 61.0)


def test_a_margin_may_be_left_in_two_intervals_and_by_no_impossible_value():
    found = solve(lambda x: (x - 1.0) ** 2 - 25.0, possible=lambda x: abs(x) < 30.0)
    first, second = found.intervals
    assert [first.high, second.low] == pytest.approx([-4.0, 6.0])
    assert [first.low, second.high] == pytest.approx([-30.0, 30.0])
    assert (first.low_open, second.high_open) == (False, False)


def test_a_margin_that_hardly_moves_does_not_move():
    with pytest.raises(ValueError, match=r"a\.key moves this margin by nothing"):
        solve(lambda x: 1e-12 * x)
    assert len(solve(lambda x: 1e-9 * x).intervals) == 1
    assert solve(lambda _: -math.inf).intervals == ()
    assert solve(lambda _: -math.inf).best_db == -math.inf


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: link_study._no_such_key("answer.power", ["beacon.power", "communication.power", "answer.divergence"]),
     'no table of the links has a quantity "answer.power"; did you mean beacon.power or communication.power?'),
    (lambda: link_study._no_such_key("beacon.divergance", ["beacon.divergence", "beacon.power",
            "terminals.leo_aperture"]),
     'no table of the links has a quantity "beacon.divergance"; did you mean beacon.divergence or beacon.power?'),
    (lambda: link_study._no_such_key("x" * 70, ["beacon.divergence", "beacon.power"]),
     'no table of the links has a quantity "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"; there '
     "are beacon.divergence, beacon.power"),
])  # fmt: skip
def test_a_key_that_is_none_is_answered_with_its_like(found, expected):
    assert found() == expected


def biased(folder, *bias):
    return link_file(folder, NO_BEAMS, {"jitter": {**UNLIKE["jitter"], "bias": list(bias)}})


@pytest.mark.parametrize(("bias", "key", "searched"), [
    (("0 urad", "-1 urad"), "jitter.bias", (-1.0, -1e-12)),
    pytest.param(
        ("-4 urad", "1 urad"), "jitter.bias", (-math.pi / 2, -4e-12), marks=pytest.mark.endurance
    ),
    (("1 urad", "-2 urad"), "jitter.bias.2", (-math.pi / 2, -2e-12)),
])  # fmt: skip
def test_values_below_0_are_looked_for_by_their_size_and_told_in_order(tmp_path, bias, key, searched):
    solution = link_study.solve_key(biased(tmp_path, *bias), key)
    found = only(solution)
    assert solution.solved.searched == pytest.approx(searched, rel=1e-12, abs=0.0)
    assert searched[0] < found.low < found.high < 0.0 and (found.low_open, found.high_open) == (False, True)
    assert solution.value == found.low == min(solution.file.mission.jitter.bias_rad)
    assert link_study.run_link_study(solution.file).communication.margin_db == pytest.approx(3.0)


def test_an_item_that_is_0_is_refused_by_its_place(tmp_path):
    with pytest.raises(ValueError, match=r"^jitter\.bias\.1 is 0, which no factor moves"):
        link_study.solve_key(biased(tmp_path, "0 urad", "-1 urad"), "jitter.bias.1")


@pytest.mark.parametrize(("key", "unit", "was"), [
    ("communication.transmit_power", "W", '"4 W"'),
    ("communication.transmit_optics_loss", "dB", ""),
    ("communication.strehl", "dB", "0.5"),
])  # fmt: skip
def test_a_value_solved_for_says_so_and_stands_in_place_of_no_other(tmp_path, key, unit, was):
    file = link_file(tmp_path, NO_BEAMS, {"communication.data_rate": "100 Mbit/s"})
    own = replace(file.sources[key], comment="paper: Table 2", was=was) if was else None
    others = {name: each for name, each in file.sources.items() if name != key}
    solution = link_study.solve_key(replace(file, sources=others | ({key: own} if was else {})), key)
    given = solution.file.sources[key]
    shown = format_quantity(solution.value, unit)
    assert given == Source(own.line if was else 0, "solved for: 3 dB of communication", shown)
    assert given.text == "solved for: 3 dB of communication"
    assert {name: each for name, each in solution.file.sources.items() if name != key} == others


@pytest.mark.parametrize(("key", "values", "largest"), [
    ("rms", ("2 urad", "3 urad"), 3e-6),
    ("rms", ("3 urad", "2 urad"), 3e-6),
    ("bias", ("1 urad", "-2 urad"), -2e-6),
])  # fmt: skip
def test_where_no_value_leaves_the_margin_the_file_keeps_its_own_with_the_larger_axis(
    tmp_path, monkeypatch, key, values, largest
):
    monkeypatch.setattr(variation, "STEPS", 1)  # few are enough where none leaves it
    jitter = {"jitter": UNLIKE["jitter"] | {key: list(values)}}
    file = link_file(tmp_path, NO_BEAMS, jitter, {"communication.data_rate": "100 Gbit/s"})
    solution = link_study.solve_key(file, f"jitter.{key}")
    assert (solution.solved.intervals, solution.value, solution.unit) == ((), largest, "rad")
    assert solution.file == file


@pytest.mark.parametrize("given", [{"possible": lambda x: x < 30.0}, {"below": 5.0}, {"above": -2.0}])
def test_a_margin_that_is_the_same_wherever_there_is_one_does_not_move(given):
    with pytest.raises(ValueError, match=r"^a\.key moves this margin by nothing$"):
        solve(lambda _: 4.5, **given)


def axes_of(*values):
    """An input of several items, whose tables are the numbers by their places."""
    rule = SimpleNamespace(out_of_bounds=lambda number: "")

    def moving(place):
        return lambda tables, number: (*tables[:place], number, *tables[place + 1 :])

    return tuple(
        SimpleNamespace(key="a.key", shown=f"a.key.{place + 1}", value=value, rule=rule, moved=moving(place))
        for place, value in enumerate(values)
    )


@pytest.mark.parametrize(("values", "said"), [
    ((0.0, 0.0), "a.key is 0, which no factor moves: give it a value to begin with"),
    ((2.0, -3.0), "a.key moves this margin by nothing"),
    ((0.0,), "a.key.1 is 0, which no factor moves: give it a value to begin with"),
    ((2.0,), "a.key.1 moves this margin by nothing"),
])  # fmt: skip
def test_an_input_of_two_axes_is_refused_by_its_key_and_one_axis_with_its_place(values, said):
    with pytest.raises(ValueError) as refused:
        variation.solve(values, axes_of(*values), "m", lambda tables: 1.0, 0.0, lambda tables: True)
    assert str(refused.value) == said


@pytest.mark.parametrize(("values", "best"), [((2.0, -3.0), -12.0), ((-3.0, 2.0), -12.0), ((4.0, 1.0), 4.0)])
def test_axes_are_moved_in_proportion_to_the_one_that_is_larger_in_size(values, best):
    """The margin is left where the sizes of both together are from 5 to 20: of 3 and 2 parts, or of 4 and 1."""

    def margin_db(tables):
        assert tables[0] * values[1] == pytest.approx(tables[1] * values[0])
        size = sum(abs(each) for each in tables)
        return min(size - 5.0, 20.0 - size)

    found = variation.solve(values, axes_of(*values), "m", margin_db, 0.0, lambda tables: True)
    (kept,) = found.intervals
    share = abs(best) / best * max(abs(each) for each in values) / sum(abs(each) for each in values)
    assert sorted((kept.low, kept.high)) == pytest.approx(sorted((5.0 * share, 20.0 * share)))
    assert (kept.low_open, kept.high_open) == (False, False)


@pytest.mark.parametrize(("end", "possible", "expected"), [
    (9.0, lambda x: x < 2.5, 2.0),  # 9, 5 and 3 are too far
    (-7.0, lambda x: x > -2.0, -1.0),  # -7 and -3 are
    (9.0, lambda x: True, 9.0),
    (1.0, lambda x: False, 1.0),
])  # fmt: skip
def test_the_step_of_a_swing_is_halved_until_there_is_such_a_mission(end, possible, expected):
    assert variation._nearest(1.0, numbered(1.0), end, possible) == expected


@pytest.mark.parametrize(("key", "hint"), [
    ("x" * 57 + ".power", "there are beacon.power, answer.gain"),  # what is cut off is no name, so that none is alike
    ("x" * 54 + ".power", "did you mean beacon.power?"),
])  # fmt: skip
def test_a_key_that_is_too_long_to_be_told_is_looked_for_as_far_as_it_is_told(key, hint):
    said = link_study._no_such_key(key, ["beacon.power", "answer.gain"])
    assert said == f'no table of the links has a quantity "{key[:60]}"; {hint}'
