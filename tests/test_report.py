"""The report: whole or absent, self-contained, with its numbers and their origin in files."""

import csv
import hashlib
import json
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
import xarray as xr

from microrad import folder, missionfile, report, study
from microrad.performance import Cost
from microrad.report import day_plots, figures, link_figures, words
from shipped import SHIPPED, edited_file


@pytest.fixture(scope="module", autouse=True)
def no_fine_pointing():
    """The fine-pointing loop has tests of its own and takes the longest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study.fine_pointing, "run", lambda *args: None)
        yield


@pytest.fixture(scope="module")
def paper():
    return study.run(missionfile.load_mission(SHIPPED))


@pytest.fixture(scope="module")
def written(paper, tmp_path_factory):
    target = tmp_path_factory.mktemp("report") / "study"
    page = report.write(paper, target)
    assert page == target / "report.html"
    return target


class Links(HTMLParser):
    """Everything a page would load or link to."""

    def __init__(self):
        super().__init__()
        self.found, self.scripts = [], 0

    def handle_starttag(self, tag, attrs):
        self.scripts += tag == "script"
        names = {"src", "href", "xlink:href", "data", "action", "poster", "srcset"}
        self.found += [value for name, value in attrs if name in names]


def test_the_page_loads_nothing_and_opens_with_the_verdict(written, paper):
    text = (written / "report.html").read_text(encoding="utf-8")
    links = Links()
    links.feed(text)
    assert [link for link in links.found if not link.startswith(("#", "data:image/png;base64,"))] == []
    assert links.scripts == 0
    assert "@import" not in text
    assert not re.search(r"url\((?!#)", text)
    body = text[text.index("<body>") :]
    assert body.index(report.words.headline(paper)) < body.index("Warnings") < body.index("The paper against this run")
    assert body.index("The paper against this run") < body.index("Link budgets") < body.index("Assumptions")


def test_the_page_holds_what_the_paper_is_judged_by(written):
    text = (written / "report.html").read_text(encoding="utf-8")
    for needed in ("76", "291 photons per bit", "hence circular", "Homodyne BPSK", "18.1", "non-physical reversals"):
        assert needed in text
    for claim in ("Fig. 5", "Fig. 6", "Fig. 8", "Table 2", "section 2.1", "section 3.2"):
        assert claim in text


def test_each_figure_is_an_svg_with_its_data(written, paper):
    drawn = (*figures.draw(paper), *link_figures.draw(paper.links), *day_plots.draw(paper.day))
    assert [f.name for f in drawn] == [
        "fig2-margin-map",
        "fig5-hysteresis-loops",
        "fig6-pid",
        "fig8-inverse",
        "comparison",
        "claims-scan",
        "tornado",
        "tornado-beacon",
        "tornado-answer",
        "wide-beam-or-scan",
        "day-timeline",
        "along-contact",
        "data-volume",
        "latency",
        "world-map",
        "assumptions",
    ]
    names = {p.name for p in (written / "figures").iterdir()}
    assert names == {f.name + ending for f in drawn for ending in (".svg", ".csv")}
    for figure in drawn:
        assert (written / "figures" / f"{figure.name}.svg").read_text(encoding="utf-8") == figure.svg
        with (written / "figures" / f"{figure.name}.csv").open(newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file))
        assert header == list(figure.columns)
        for place, column in enumerate(figure.columns.values()):
            kept = [row[place] for row in rows if row[place]]
            assert len(kept) == np.size(column)
            np.testing.assert_allclose(np.array(kept, dtype=float), column, rtol=1e-8, atol=1e-18)


def test_the_map_shows_the_contours_with_their_labels_and_the_band_of_the_readings(written):
    svg = (written / "figures" / "fig2-margin-map.svg").read_text(encoding="utf-8")
    words = [each.text for each in ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]
    for needed in ("0 dB", "3 dB", "3 dB by other readings of the conventions", "budget: 300 Mbit/s at 10 \u00b5rad"):
        assert words.count(needed) == 1, needed
    assert "6 dB" not in words  # no other contour has a label


def test_results_carry_units_and_the_numbers_of_the_study(written, paper):
    tree = xr.open_datatree(written / "results.nc", engine="h5netcdf")
    try:
        for node in tree.subtree:
            for variable in node.to_dataset(inherit=False).variables.values():
                assert variable.attrs["units"]
                assert variable.attrs["long_name"]
        margin = tree["margin_map"]["margin"]
        assert margin.attrs["units"] == "dB"
        np.testing.assert_array_equal(margin.values, paper.margin_map.margin_db)
        run = tree["tracking/given_pid_inverse_25_hz"]
        assert run.attrs["peak_error_rad"] == paper.residual.trace.peak_rad
        error = (run["reference"] - run["output"]).values[run.attrs["steady_from_sample"] :]
        assert np.max(np.abs(error)) == pytest.approx(paper.residual.trace.peak_rad, rel=1e-12)
        assert tree.attrs["mission_sha256"] == hashlib.sha256(SHIPPED.read_bytes()).hexdigest()
    finally:
        tree.close()


def test_the_manifest_names_mission_versions_and_every_file(written):
    manifest = json.loads((written / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["mission"]["text"] == SHIPPED.read_text(encoding="utf-8")
    assert manifest["mission"]["sha256"] == hashlib.sha256(SHIPPED.read_bytes()).hexdigest()
    assert {"python", "microrad", "numpy", "numba"} <= set(manifest["versions"])
    files = {str(p.relative_to(written)): p for p in written.rglob("*") if p.is_file() and p.name != "manifest.json"}
    assert set(manifest["files_sha256"]) == set(files)
    for name, path in files.items():
        assert manifest["files_sha256"][name] == hashlib.sha256(path.read_bytes()).hexdigest()


def test_two_runs_write_the_same_page_and_figures(paper, written, tmp_path):
    report.write(paper, tmp_path / "again")
    for path in [written / "report.html", *(written / "figures").iterdir()]:
        assert (tmp_path / "again" / path.relative_to(written)).read_bytes() == path.read_bytes()


def test_results_are_never_replaced_silently(paper, tmp_path):
    target = tmp_path / "out"
    report.write(paper, target)
    before = {p: p.read_bytes() for p in target.rglob("*") if p.is_file()}
    with pytest.raises(report.FolderError, match="already holds results: choose another --output, or replace"):
        report.write(paper, target)
    assert {p: p.read_bytes() for p in target.rglob("*") if p.is_file()} == before
    (target / "left over.txt").write_text("x")
    report.write(paper, target, overwrite=True)
    assert not (target / "left over.txt").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]


@pytest.mark.parametrize("manifest", [None, "{}", "not JSON", '{"versions": {"other": "1"}}', '{"versions": 3}'])
def test_a_folder_of_others_is_never_replaced(tmp_path, manifest):
    (tmp_path / "thesis.txt").write_text("years of work")
    if manifest is not None:
        (tmp_path / "manifest.json").write_text(manifest)
    with pytest.raises(report.FolderError, match="not results of microrad"):
        report.check_folder(tmp_path, overwrite=True)
    assert (tmp_path / "thesis.txt").read_text() == "years of work"


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    path = tmp_path / "taken"
    path.write_text("x")
    with pytest.raises(report.FolderError, match="is a file, not a folder"):
        report.check_folder(path, overwrite=True)


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device"), MemoryError])
def test_an_interrupted_write_leaves_nothing_and_keeps_the_old(tmp_path, error):
    target = tmp_path / "out"
    with folder.whole_folder(target, overwrite=False) as draft:
        (draft / "manifest.json").write_text('{"mission": {}, "versions": {"microrad": "0"}}')
    with pytest.raises(BaseException) as caught, folder.whole_folder(target, overwrite=True) as draft:
        (draft / "half").write_text("written")
        raise error
    assert not isinstance(caught.value, report.FolderError)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]
    assert sorted(p.name for p in target.iterdir()) == ["manifest.json"]


def test_text_of_the_mission_is_escaped(tmp_path):
    file = edited_file(
        tmp_path, ('name = "LEO-to-GEO relay of a 100 kg satellite"', 'name = "<script>alert(1)</script>"')
    )
    page = report.write(study.run(file), tmp_path / "out").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page


def test_a_hopeless_link_is_reported_not_refused(tmp_path):
    file = edited_file(tmp_path, ('data_rate = "300 Mbit/s"', 'data_rate = "30 Gbit/s"'))
    hopeless = study.run(file)
    assert not hopeless.closes
    assert hopeless.communication.margin_db == pytest.approx(3.0 - 20.0, abs=0.02)
    assert math.isnan(hopeless.margin_map.largest_error_rad)
    assert "does not close" in report.verdict_text(hopeless)
    assert "not even on axis" in report.write(hopeless, tmp_path / "out").read_text(encoding="utf-8")


def test_verdict_and_summary_say_the_same(paper):
    text, data = report.verdict_text(paper), report.summary(paper)
    assert data["closes"] is True
    assert data["verdict"] in text
    assert [line.split()[0] for line in text.splitlines()[-5:]] == ["PASS", "PASS", "PASS", "FAIL", "FAIL"]
    assert [r["met"] for r in data["requirements"]] == [True, True, True, False, False]
    assert min(data["implied_sensitivity_photon_bit"]) == pytest.approx(76, abs=0.5)
    assert max(data["implied_sensitivity_photon_bit"]) == pytest.approx(291, abs=0.5)
    json.dumps(data)


def test_a_drive_beyond_the_identified_rate_is_the_first_thing_said(tmp_path):
    slow = study.run(edited_file(tmp_path, ('rate_limit = "3770 V/s"', 'rate_limit = "100 V/s"')))
    assert "Not to be relied on" in report.verdict_text(slow)
    assert any("(identified up to 100 V/s)" in w for w in report.summary(slow)["warnings"])
    assert "Not to be relied on" not in report.verdict_text(study.run(missionfile.load_mission(SHIPPED)))


def test_thinning_keeps_every_peak():
    y = np.zeros(100_001)
    y[[5, 77_777, 100_000]] = 3.0, -2.0, 1.0
    x = np.arange(y.size, dtype=float)
    thin_x, thin_y = figures.thin(x, y)
    assert thin_x.size <= 2 * figures.MOST_POINTS
    assert set(thin_y) >= {3.0, -2.0}
    np.testing.assert_array_equal(thin_y, y[thin_x.astype(int)])
    assert np.all(np.diff(thin_x) >= 0)


@pytest.fixture
def no_scan(monkeypatch):
    """The scan has tests of its own and takes the longest."""
    monkeypatch.setattr(study.paper, "applies", lambda mission: False)


def test_the_headline_names_the_link_that_does_not_close(no_scan, tmp_path):
    file = edited_file(tmp_path, ('required_power = "10 pW"', 'required_power = "1 nW"'))
    text = report.verdict_text(study.run(file))
    assert text.startswith("The link does not close: beacon -13.70 dB, at 300 Mbit/s")
    assert "communication" not in text.splitlines()[0]


def test_an_amplifier_at_its_limits_is_named_as_the_cause_and_claims_are_not_judged(no_scan, tmp_path):
    weak = study.run(edited_file(tmp_path, ('output_max = "180 V"', 'output_max = "100 V"')))
    assert "What limits it: the amplifier's limits (" in report.verdict_text(weak)
    assert {c.agrees for c in weak.claims if c.where in ("Fig. 6", "Fig. 8")} == {"not judged"}
    assert any("beyond the amplifier's range" in w for w in report.summary(weak)["warnings"])


def test_a_changed_value_does_not_keep_the_papers_name(no_scan, paper, tmp_path):
    assert missionfile.changed_from_shipped(paper.file) == ()
    file = edited_file(tmp_path, ('leo_aperture = "5 cm"', 'leo_aperture = "6 cm"'))
    assert missionfile.changed_from_shipped(file) == (("terminals.leo_aperture", '"6 cm"', '"5 cm"'),)
    changed = study.run(file)
    assert any("names the paper as its source" in w for w in report.summary(changed)["warnings"])
    page = report.write(changed, tmp_path / "out").read_text(encoding="utf-8")
    assert "This mission is not the paper" in page


def test_a_radial_residual_is_two_axes(no_scan, paper, tmp_path):
    radial = study.run(edited_file(tmp_path, ('residual = "per-axis"', 'residual = "radial"')))
    used, one_axis = report.summary(radial)["residual"]["used_rad"], report.summary(paper)["residual"]["used_rad"]
    assert used == pytest.approx(math.sqrt(2.0) * one_axis, rel=1e-12)
    assert "times √2 for two equal axes" in report.verdict_text(radial)
    assert radial.achieved.margin_db < paper.achieved.margin_db - 2.0


def test_a_drive_beyond_the_identified_range_is_said(no_scan, tmp_path):
    narrow = study.run(edited_file(tmp_path, ('drive_max = "12 V"', 'drive_max = "8 V"')))
    text = report.verdict_text(narrow)
    assert "The mirror model is extrapolated." in text.splitlines()[0]
    assert "(identified from 0 to 8 V)" in text
    assert any("beyond the range that the mirror was identified for" in w for w in report.summary(narrow)["warnings"])


def test_a_cost_without_a_data_rate_is_said_in_decibels_alone():
    cost = Cost("sine of 25 Hz", "PID", "given", -1.5, math.nan)
    assert words._rate_lost(cost) == ""
    assert words._rate_lost(replace(cost, data_rate_bit_s=-252.4e6)) == " or 252 Mbit/s"
