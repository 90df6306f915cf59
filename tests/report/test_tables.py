"""Tables on a terminal: which columns there is room for, and what becomes of the others."""

import re

import pytest

from microrad.report.day.tables import CONTACT_COLUMNS, contacts_table
from microrad.report.tables import Table, table_text
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
