"""Tables on a terminal: which columns there is room for, and what becomes of the others."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from microrad import report
from microrad.report.data import fields, finite
from microrad.report.day.tables import CONTACT_COLUMNS, contacts_table
from microrad.report.tables import Cell, Table, numbers_text, rows_of, table_text
from microrad.report.view import Points, Soft, Verdict, View, anchored, opened, slug, told, views_text
from shipped import plain_study

BRIEF = ("by", "rise", "set", "min", "could carry", "begins and ends by")


def heading(text):
    """Every word of the headings of a table as it stands on a terminal."""
    above, _ = text.split("\u2500", 1)
    return set(re.findall(r"[^\s()]+", above)) - {"Contacts"}


def words(headings):
    return {word for each in headings for word in re.findall(r"[^\s()]+", each)}


@pytest.mark.parametrize("width", [80, 119, 125, 131])
def test_contacts_leave_out_columns_where_words_would_be_broken(width):
    text = table_text(contacts_table(plain_study().day), width)
    assert heading(text) - {"UTC"} == words(BRIEF)
    assert len(re.findall(r"^ *GEO ", text, re.MULTILINE)) == len(plain_study().day.encounters)
    assert max(map(len, text.splitlines())) <= width


def test_contacts_have_every_column_where_there_is_room():
    text = table_text(contacts_table(plain_study().day), 132)
    assert heading(text) == words(CONTACT_COLUMNS)
    assert len(re.findall(r"^ *GEO ", text, re.MULTILINE)) == len(plain_study().day.encounters)
    assert max(map(len, text.splitlines())) <= 132


def test_the_last_words_stand_below_each_other_on_a_narrow_terminal():
    number = Table("", ("name", "value", "basis", "source"), [("a", "1", "formula", "paper")], (0, 2, 3))
    assert number.narrowed().rows == [["a", "1", "formula\nsource: paper"]]
    wordy = Table("", ("input", "value", "source"), [("a", "one", "paper"), ("b", "two", "")], (0, 1, 2))
    assert wordy.narrowed().rows == [["a", "one\nsource: paper"], ["b", "two"]]
    pair = Table("", ("input", "value"), [("a", "one")], (0, 1))
    assert pair.narrowed() == pair
    assert "source: paper" in table_text(wordy, 40)
    assert "source: paper" not in table_text(wordy, 140)


@pytest.mark.parametrize(("width", "parts"), [(45, 1), (44, 2), (27, 2), (26, 3)])
def test_numbers_that_a_terminal_has_no_room_for_stand_below_and_lose_no_digit(width, parts):
    table = Table(
        "tails", ("first", "one independent", "two", "independent samples"), [("PI", "7", "3", "35154")], (0, 3)
    )
    text = table_text(table, width)
    assert len(table.parts(width)) == text.count("first") == text.count("PI") == parts
    assert text.count("tails") == 1
    assert {"7", "3", "35154", "independent", "samples", "one", "two"} <= set(text.split())


@pytest.mark.parametrize("width", range(48, 69))
def test_columns_of_words_share_what_is_left_without_breaking_a_word(width):
    """Each has its longest word; then the one that lacks least has all of its line, before the others have more."""
    headings = ("pointing error from", "one independent", "two", "independent samples")
    table = Table("", headings, [("jitter as given", "7", "3", "35154")], (0, 3))
    assert table.widths(width) == [8 + min(max(width - 56, 0), 11), 15, 3, 11 + min(width - 48, 8)]
    text = table_text(table, width)
    assert {*text.split()} >= {"pointing", "error", "from", "independent", "samples", "jitter", "given", "35154"}
    assert max(map(len, text.splitlines())) <= width


def wordy_table():
    rows = [("a", "1", "-22", Cell("w", "FAIL"), "long words here"), ("bb", "", "3", "", Cell("k", code=True))]
    return Table("T", ("name", "x", "y", "why", "what"), rows, (0, 3, 4), names={1: "n", 2: ("p", "q")}, brief=(4, 0))


def test_a_brief_table_has_its_columns_in_the_order_that_it_names():
    lines = [" what              name", " ──────────────────────", " long words here   a", " k                 bb"]
    assert [line for line in table_text(wordy_table(), 60).split("\n") if line][1:] == lines
    assert wordy_table().for_width(60).name(1, 0) == "" and wordy_table().for_width(120).name(1, 2) == "q"


def test_columns_that_are_kept_take_their_words_and_names_along():
    kept = wordy_table().columns((2, 4, 1))
    assert (list(kept.headings), list(kept.words), dict(kept.names)) == (
        ["y", "what", "x"],
        [1],
        {0: ("p", "q"), 2: "n"},
    )
    assert [kept.name(row, column) for row in (0, 1) for column in (0, 1, 2)] == ["p", "", "n", "q", "", "n"]
    assert [list(map(str, row)) for row in kept.rows] == [["-22", "long words here", "1"], ["3", "k", ""]]


@pytest.mark.parametrize(
    ("width", "widths"),
    [
        (60, [4, 1, 3, 6, 15]),
        (41, [4, 1, 3, 6, 13]),
        (33, [4, 1, 3, 6, 5]),
        (32, [4, 1, 3, 5, 5]),
        (30, [4, 1, 3, 4, 5]),
    ],
)
def test_what_is_left_of_a_line_goes_to_the_column_that_lacks_least(width, widths):
    assert wordy_table().widths(width) == widths


@pytest.mark.parametrize(
    ("cell", "text"),
    [(("a", "!"), "a !"), (("", "!"), "!"), (("a",), "a"), (("", ""), ""), (("a", "PASS", "hint"), "a PASS")],
)
def test_a_cell_is_its_text_with_its_mark(cell, text):
    assert str(Cell(*cell)) == text


@pytest.mark.parametrize(
    ("columns", "rows"),
    [
        ({}, []),
        ({"a": np.empty(0)}, []),
        ({"a": ()}, []),
        (
            {"a": np.array([1.0, np.nan, -2.5e-7]), "b": ("x",), "c": np.empty(0)},
            [("1", "x", ""), ("",) * 3, ("-2.5e-07", "", "")],
        ),
        ({"a": ("nan", "%d"), "b": np.array([-0.0, -np.inf])}, [("nan", "-0"), ("%d", "-inf")]),
        ({"a": np.array([1234.56])}, [("1.23e+03",)]),
    ],
)
def test_columns_of_any_lengths_become_rows_of_text(columns, rows):
    assert rows_of(columns, 3) == rows


@pytest.mark.parametrize(
    ("columns", "digits", "text"),
    [
        ([[1.0, 2.0], [math.nan, -0.5, 3e9]], 4, "1; |2; -0.5|; 3e+09|"),
        ([[1.0 / 3.0]], 9, "0.333333333|"),
        ([[], []], 3, ""),
        ([[math.inf], []], 3, "inf; |"),
    ],
)
def test_numbers_as_one_text_are_parted_as_they_are_told(columns, digits, text):
    assert numbers_text([np.array(each) for each in columns], digits, "; ", "|") == text


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("One & two", "one-two"),
        ("  Ä b--C! ", "b-c"),
        ("§", "part"),
        ("a_b.c", "a-b-c"),
        ("M&S 32", "m-s-32"),
        ("", "part"),
    ],
)
def test_an_anchor_has_small_letters_digits_and_strokes(text, name):
    assert slug(text) == name


def test_anchors_within_anchors_are_apart_from_those_that_others_have():
    taken = {"a", "b"}
    outer, other = anchored([View("A", [View("B"), "words", View("a-2")]), View("A", anchor="c")], taken)
    assert [outer.anchor, *(view.anchor for view in outer.views), other.anchor] == ["a-2", "b-2", "a-2-2", "c"]
    assert taken == {"a", "b", "a-2", "b-2", "a-2-2", "c"} and outer.blocks[1] == "words"


@pytest.mark.parametrize(
    ("blocks", "kept"),
    [
        ((None, "", Points([]), Points(["a"]), "x", Soft("")), (Points(["a"]), "x", Soft(""))),
        ((), ()),
        ((View("t"), Verdict("h"), None), (View("t"), Verdict("h"))),
    ],
)
def test_blocks_that_say_nothing_are_left_out(blocks, kept):
    assert told(*blocks) == kept


def test_figures_that_are_not_named_are_folded_under_their_title():
    one, two = (SimpleNamespace(name=name, title=f"Title {name}") for name in "ab")
    shown, folded = opened([one, two], ["a", "c"])
    assert shown is one and folded == View("Title b", [two], "", True, False)


def test_a_verdict_holds_its_blocks_and_a_list_within_a_list_of_sentences():
    inner = Table("", ("a", "b"), [("x", "1")], (0,))
    blocks = ["One.", Verdict("Head.", ["Below.", inner, Points(["p " * 12])], False), "Two.", "", "Three."]
    assert views_text(blocks, 20).split("\n") == [
        *("One.", "", "Head.", "Below.", "", " a   b", " ─────", " x   1", "", "- p p p p p p p p p", "  p p p"),
        *("", "Two.", "", "Three."),
    ]


@pytest.mark.parametrize(
    ("data", "found"),
    [
        ({"a": (1, np.float64("nan"), np.int64(3))}, {"a": [1, None, 3]}),
        ([math.inf, {"c": np.bool_(True)}, "x"], [None, {"c": True}, "x"]),
        ({1: -math.inf, "d": {}}, {1: None, "d": {}}),
        (np.float32(0.5), 0.5),
    ],
)
def test_plain_data_have_none_for_what_is_not_finite(data, found):
    assert finite(data) == found and type(finite(data)) is type(found)


def test_fields_of_a_record_come_in_the_order_that_is_asked_for():
    assert list(fields(SimpleNamespace(a=1, b=2, c=3), "c", "a").items()) == [("c", 3), ("a", 1)]


def test_a_plan_is_written_for_a_spreadsheet_and_as_a_contact_plan(tmp_path, monkeypatch):
    from microrad.orbit import operations

    monkeypatch.setattr(operations, "csv_text", lambda planned, utc: f"{planned} at {utc} µ")
    plan = SimpleNamespace(planned="sessions", epoch=SimpleNamespace(utc="noon"), contact_plan=lambda: "a contact é")
    report.write_plan(plan, tmp_path)
    found = {path.name: path.read_bytes().decode() for path in tmp_path.iterdir()}
    assert found == {"sessions.csv": "sessions at noon µ\n", "contact-plan.ionrc": "a contact é\n"}


def test_a_name_that_the_report_has_not_is_said_to_be_missing():
    with pytest.raises(AttributeError, match=r"module 'microrad\.report' has no attribute 'nothing'"):
        _ = report.nothing
    assert {name for name in report.__all__ if not callable(getattr(report, name))} == set()


@pytest.mark.parametrize(
    ("width", "widths"), [(28, [22, 1]), (25, [19, 1]), (22, [16, 1]), (21, [16, 1]), (10, [16, 1]), (0, [16, 1])]
)
def test_a_word_of_more_than_sixteen_letters_is_folded_and_no_column_is_narrower_than_its_least(width, widths):
    word = "abcdefghijklmnopqrstuv"
    table = Table("", ("name", "x"), [(word, "7")], (0,))
    assert table.widths(width) == widths
    if width == 22:
        lines = [line.split() for line in table_text(table, width).splitlines()]
        assert lines[2:] == [[word[:16], "7"], [word[16:]]]


def test_the_first_column_stands_beside_each_other_one_however_little_room_there_is():
    headings = ("station", "rise", "set")
    table = Table("Contacts", headings, [("s" * 14, "1" * 12, "2" * 12)], (0,), totals=1)
    parts = table.parts(20)
    assert [list(each.headings) for each in parts] == [["station", "rise"], ["station", "set"]]
    assert [(each.title, each.totals) for each in parts] == [("Contacts", 1), ("", 1)]
    assert [list(each.headings) for each in table.parts(46)] == [["station", "rise", "set"]]  # 14 + 12 + 12 and gaps
    assert [list(each.headings) for each in Table("", headings[:2], [("a" * 9, "1" * 40)]).parts(20)] == [
        ["station", "rise"]
    ]
