"""A report's page but for our own scripts, to look at everything else in it; and how its parts refer to each other."""

import re
from collections import Counter
from html.parser import HTMLParser

from microrad.report.page import templates as scripts


def without_scripts(page):
    """The page without the data of its figures, none of which holds a tag, and without the drawing library."""
    data = re.escape(scripts.MARK) + "[^<]*</script>\n?"
    return re.sub(data, "", page.replace(scripts.library(), "").replace(scripts.keyboard(), ""))


class _Ids(HTMLParser):
    """Every id of a page, every id that something in it refers to, and headings of tables that say nothing."""

    def __init__(self, page):
        super().__init__()
        self.own, self.wanted, self.silent, self._th = [], set(), 0, None
        self.feed(without_scripts(page))
        self.close()

    def handle_starttag(self, tag, attrs):
        self._th = "" if tag == "th" else self._th
        for name, value in attrs:
            if name == "id":
                self.own.append(value)
            elif name in ("aria-labelledby", "aria-describedby", "for"):
                self.wanted.update(value.split())
            elif name in ("href", "xlink:href") and value.startswith("#"):
                self.wanted.add(value[1:])
            self.wanted.update(re.findall(r"url\(#([^)]*)\)", value or ""))

    def handle_data(self, data):
        self._th = None if self._th is None else self._th + data

    def handle_endtag(self, tag):
        if tag == "th":
            self.silent += not (self._th or "").strip()
            self._th = None


def assert_sound(page):
    """Each id is that of one element, all that is referred to is there, and each heading of a table says something."""
    found = _Ids(page)
    assert [each for each, count in Counter(found.own).items() if count > 1] == []
    assert all(re.fullmatch(r"[A-Za-z][A-Za-z0-9_.-]*", each) for each in found.own)
    assert found.wanted <= set(found.own), found.wanted - set(found.own)
    assert found.silent == 0
