"""README.md and the front page lead to pages that hold what they say, and each page has a title that fits."""

import re

import pytest

from places import ROOT
from site_pages import conventions, validation

DOCS = ROOT / "docs"
README = (ROOT / "README.md").read_text(encoding="utf-8")
INDEX = (DOCS / "index.md").read_text(encoding="utf-8")


def headings(name):
    """The headings of a page: its title, and those of its sections."""
    return re.findall(r"(?m)^#+ (.+)$", (ROOT / name).read_text(encoding="utf-8"))


@pytest.mark.promise("readme-36", "readme-37", "readme-38", "readme-39", "readme-40")
@pytest.mark.promise("hysteresis-23", "hysteretic-stiffness-31")
@pytest.mark.parametrize(
    ("page", "words", "wanted"),
    [
        (
            "docs/report.md",
            "says what each part of it holds, and where its numbers come from.",
            ["What each part says, and where its numbers come from"],
        ),
        (
            "docs/identify.md",
            "says what to record and how a model is chosen,",
            ["What to record", "What happens", "How the winner is chosen"],
        ),
        (
            "docs/hysteretic-stiffness.md",
            "what model holds at all amplitudes,",
            ["The physics", "The model", "No drive makes it run away", "The fit", "What it is worth on a real mirror"],
        ),
        ("docs/recordings.md", "what is read and checked,", ["Formats", "Whole arrays", "Several channels", "Checks"]),
        ("docs/bench.md", "what a plan holds.", ["The plan"]),
        (
            "docs/campaigns.md",
            "has the file, the ledger, the exports and how to run on a cluster.",
            ["The campaign file", "The ledger", "Export", "On a cluster"],
        ),
        (
            "docs/studio.md",
            "has its pages, its limits, and what it protects from.",
            ["The pages", "Limits of uploads", "Security"],
        ),
        ("VISION.md", "What it is not, and what it does not do yet:", ["What it is not", "What it does not do yet"]),
        ("CONTRIBUTING.md", "How it is built:", ["The house"]),
    ],
)
def test_a_page_that_the_readme_names_has_sections_on_what_it_says(page, words, wanted):
    link = f"[{page}]({page})"
    assert f"{link} {words}" in README or f"{words} {link}" in " ".join(README.split())
    found = headings(page)
    assert [each for each in wanted if each not in found] == []


@pytest.mark.promise("index-4")
def test_each_question_of_the_front_page_leads_to_a_page_whose_title_fits():
    """Two of them are made from the code."""
    made = {name: text for each in (conventions, validation) for name, text in each.pages().items()}
    table = INDEX.partition("| question | page |")[2].partition("\n\n")[0]
    rows = re.findall(r"(?m)^\| (.+\?) \| \[(.+)\]\((.+)\) \|$", table)
    assert len(rows) == table.count("\n") - 1 > 8
    title_of = {
        name: re.match(r"# (.+)", made[name] if name in made else (DOCS / name).read_text(encoding="utf-8"))[1]
        for _, _, name in rows
    }
    assert len(title_of) == len(rows)
    unlike = {"Link budgets": "Link, pointing and acquisition budgets", "Identify": "From recordings to a mirror model"}
    for _, said, name in rows:
        assert title_of[name].startswith(said) or title_of[name] == unlike[said]
    hidden = re.findall(r"(?ms)^```\{toctree\}.*?^```$", INDEX)
    named = {line for each in hidden for line in each.splitlines() if re.fullmatch(r"[\w/-]+", line)}
    assert {name.removesuffix(".md") for name in title_of} <= named
