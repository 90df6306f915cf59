"""Each promise of a page has a test that names it, and each test names promises that are there."""

from collections import Counter

from site_pages import promises


def test_a_promise_bears_the_name_of_its_page_and_stands_once():
    for page, text in promises.documents().items():
        marks = promises.promised(text)
        assert marks, f"{page} promises nothing"
        assert len(marks) == text.count("<!-- promise"), f"{page}: a mark is not of the form <!-- promise: {page}-1 -->"
        assert {mark.rpartition("-")[0] for mark in marks} <= {page}
        assert [mark for mark, times in Counter(marks).items() if times > 1] == []


def test_each_promise_is_shown_and_what_is_shown_is_promised():
    made = {mark for text in promises.documents().values() for mark in promises.promised(text)}
    shown = promises.shown()
    assert sorted(made - set(shown)) == [], "promised, and no test names it"
    assert sorted(set(shown) - made) == [], "named by a test, and no page promises it"


def test_a_page_is_shown_with_links_to_what_shows_it():
    text = "It writes three files.\n<!-- promise: day-1 -->\n\nNext. <!-- promise: hysteretic-stiffness-12 -->\n"
    assert promises.promised(text) == ["day-1", "hysteretic-stiffness-12"]
    assert promises.linked(text).startswith(
        'It writes three files. <a class="promise" id="day-1" href="promises.html#day-1">'
    )
