"""The documentation site: it builds without a warning, leads nowhere false, loads nothing, and has all that it should.

It is built once for all tests here, by `make endurance` alone, as by `make site`. Pages, examples and promises have
tests of their own, and tests/test_notebooks.py runs the code of most notebooks.
"""

import re
import subprocess
import sys
from html import unescape

import pytest

import microrad

pytest.importorskip("sphinx", reason="the site's builder is not installed (the extra docs)")

import build_site
from site_pages import cases, commands, formulas, names
from site_pages.tables import plain


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site, by what `make site` runs, and what it printed."""
    folder = tmp_path_factory.mktemp("site") / "html"
    command = [sys.executable, build_site.ROOT / "scripts" / "build_site.py", folder]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    return folder, ran


def text_of(page):
    """What a page says, without its markup."""
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", page.read_text(encoding="utf-8"))).split())


@pytest.mark.promise("decisions-1", "readme-17")
@pytest.mark.endurance
def test_nothing_is_wrong_with_it(site):
    folder, ran = site
    assert (ran.returncode, ran.stdout) == (0, f"{folder / 'index.html'}\n"), ran.stdout + ran.stderr
    assert (folder / "index.html").is_file()
    assert [*folder.parent.iterdir()] == [folder], "something was left beside it"
    assert any(address.startswith("https://") for address in build_site.external_links(folder))


@pytest.mark.promise("readme-17")
@pytest.mark.endurance
def test_every_page_of_the_folder_is_in_it(site):
    folder, _ = site
    found = {path.stem for path in (build_site.ROOT / "docs").glob("*.md")}
    assert {"link", "choose", "hysteresis", "decisions"} <= found
    assert found <= {path.stem for path in folder.glob("*.html")}


@pytest.mark.endurance
def test_the_page_that_a_refusal_names_is_there(site):
    folder, _ = site
    sources = (build_site.ROOT / "src" / "microrad").rglob("*.py")
    named = {page for each in sources for page in re.findall(r'^    page = "(\w+)"$', each.read_text("utf-8"), re.M)}
    assert {"link", "campaigns"} <= named
    assert named <= {path.stem for path in folder.glob("*.html")}


@pytest.mark.promise("readme-17")
@pytest.mark.endurance
def test_every_public_name_has_a_page_with_its_arguments(site):
    folder, _ = site
    assert set(names.names()) == {name for name in dir(microrad) if not name.startswith("__")}
    listed = [name for group in names._groups().values() for name in group]
    assert sorted(listed) == sorted(names.names())
    for name in names.names():
        page = (folder / "names" / f"{name}.html").read_text(encoding="utf-8")
        assert f'id="microrad.{name}"' in page, name
        assert 'class="highlight-python' in page, f"{name} has no example"
        assert "_NestedSequence" not in page, name
    assert "ArrayLike" in text_of(folder / "names" / "outage_loss_db.html")
    study = text_of(folder / "names" / "run_study.html")
    assert "Parameters" in study and "Raises" in study
    assert "Example" in study and "load_mission" in study


@pytest.mark.promise("readme-17")
@pytest.mark.endurance
def test_every_command_is_there_with_its_options(site):
    folder, _ = site
    sections = (folder / "commands.html").read_text(encoding="utf-8").split('<section id="')
    parts = {part.partition('"')[0]: part for part in sections}
    found = dict(commands.commands())
    assert {"microrad run", "microrad campaign resume", "microrad export c"} <= found.keys()
    for name, command in found.items():
        table = parts[name.replace(" ", "-")].partition("<tbody>")[2]
        for each in command.params:
            if not getattr(each, "hidden", False) and each.param_type_name == "option":
                assert f">{each.opts[0]}" in table, (name, each.opts)


@pytest.mark.promise("readme-17")
@pytest.mark.endurance
def test_every_key_is_there(site):
    folder, _ = site
    page = text_of(folder / "keys.html")
    for key in ("modulus_margin", "receiver_sensitivity", "rate_limit", "pointing_loss"):
        assert key in page
    assert "must be there" in page


@pytest.mark.promise("decisions-5")
@pytest.mark.endurance
def test_published_cases_are_within_their_tolerance(site):
    folder, _ = site
    text = text_of(folder / "validation.html")
    met, total = map(int, re.search(r"(\d+) of (\d+) cases are within", text).groups())
    assert met == total > 90
    assert "missed" not in text
    assert "SGP4, largest difference of a position over 27 satellites" in text


def test_the_test_that_a_case_names_is_there():
    for case in (*cases.pointing(), *cases.receivers(), *cases.control()):
        path, _, name = case.test.partition("::")
        assert f"def {name}(" in (build_site.ROOT / path).read_text(encoding="utf-8"), case.test


@pytest.mark.endurance
def test_choices_have_their_figures(site):
    folder, _ = site
    text = text_of(folder / "choose.html")
    assert "linear 0.788 0.904" in text
    assert "H-infinity 1.538 1.077 / 1.096 3.71 0.655" in text
    assert "resonance at 900 Hz, damping 0.02 1.091 1.349" in text


def test_a_case_that_is_missed_says_so():
    assert cases.case("a", "b", "1.00", 1.004, "t").met
    missed = cases.case("a", "b", "1.00", 1.006, "t")
    assert not missed.met
    assert missed.shown == "1.0060"
    assert cases.case("a", "b", "1.00", 1.006, "t", 0.01).met


def test_every_formula_has_a_source_and_a_conflict_its_size():
    found = [each for group in formulas.formulas().values() for each in group]
    assert all(each.source for each in found)
    assert all(each.difference for each in found if each.status != "exact")
    assert {each.status for each in found} == {"exact", "reduction", "other source", "in conflict"}


def test_a_formula_that_is_nowhere_is_told(monkeypatch):
    gone = formulas.Formula("link.gains.no_such_gain_db", "G", "nobody", "exact")
    monkeypatch.setattr(formulas, "_GROUPS", {"Gains": lambda: [gone]})
    with pytest.raises(AttributeError, match="no_such_gain_db"):
        formulas.formulas()
    monkeypatch.setattr(formulas, "_GROUPS", {"Gains": lambda: []})
    with pytest.raises(LookupError, match=r"no row .* has .*link\.gains\.aperture_gain_db"):
        formulas.formulas()


def test_a_row_that_no_page_records_is_told():
    assert cases.recorded("pointing.md", "resonance at 900 Hz, damping 0.02")[0] == "1.091"
    with pytest.raises(LookupError, match=r"docs/pointing\.md has no row that begins with 'no such plant'"):
        cases.recorded("pointing.md", "no such plant")


@pytest.mark.promise("decisions-1")
def test_false_links_and_what_is_fetched_are_found(tmp_path):
    (tmp_path / "a.html").write_text(
        '<a href="b.html">gone</a><a href="#here">no anchor</a><a href="https://example.org/x">elsewhere</a>'
        '<script src="https://example.org/s.js"></script><p id="there"></p><a href="#there">is there</a>',
        encoding="utf-8",
    )
    (tmp_path / "a.css").write_text('@import "https://example.org/s.css"; p { background: url(own.png) }', "utf-8")
    assert build_site.faults(tmp_path) == [
        "a.css would fetch https://example.org/s.css",
        "a.html would fetch https://example.org/s.js",
        "a.html: #here has no such anchor",
        "a.html: b.html leads nowhere",
    ]
    assert build_site.external_links(tmp_path) == ["https://example.org/x"]


def test_signs_of_a_text_are_no_markup():
    assert plain("a_b * c `d_e` [f]") == r"a\_b \* c `d_e` \[f]"
