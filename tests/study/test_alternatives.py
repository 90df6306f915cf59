"""The verdict by other readings: each against the mission that is written so."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from microrad import link, report
from microrad.loop import paper_cases as tracking
from microrad.report.study import contributors as requirement_views
from microrad.report.study import words
from microrad.study import alternatives as readings
from scenes import cases_of
from shipped import edited, plain_study


@pytest.fixture(scope="module")
def found():
    return {(r.key, r.other): r for r in plain_study().other_readings}


def test_every_reading_that_fits_is_there_once(found):
    assert list(found) == [
        ("conventions.residual", "radial"),
        ("conventions.pointing_loss", "gain"),  # and "pattern" for a mission that gives a beam
        ("conventions.strehl", "ratio"),
        ("conventions.mirror_angle", "optical"),
        ("conventions.mirror_angle", "mechanical"),
        ("requirement.residual_statistic", "rms"),
        ("mirror.composition", "additive"),  # and "static" without a linear part
    ]
    assert "/".join(dict.fromkeys(r.given for r in found.values())) == (
        "per-axis/gaussian/decibel/line-of-sight/peak/cascade"
    )


@pytest.mark.parametrize(
    ("key", "change"),
    [
        (("conventions.residual", "radial"), ('residual = "per-axis"', 'residual = "radial"')),
        (("conventions.strehl", "ratio"), ('strehl = "decibel"', 'strehl = "ratio"')),
        (("requirement.residual_statistic", "rms"), ('statistic = "peak"', 'statistic = "rms"')),
        (("conventions.mirror_angle", "mechanical"), ('angle = "line-of-sight"', 'angle = "mechanical"')),
        (("mirror.composition", "additive"), ('composition = "cascade"', 'composition = "additive"')),
    ],
)
def test_a_reading_is_the_mission_written_so(tmp_path, found, key, change):
    m = edited(tmp_path, change)
    run = tracking.worst(tracking.sine_runs(cases_of(m), ("given",)), m.requirement.residual_statistic)
    left = tracking.residual_rad(m.requirement, m.conventions, run.trace)
    assert found[key].residual_rad == pytest.approx(left, rel=1e-12)
    assert found[key].margin_db == pytest.approx(float(link.margin_of_error(link.of(m), np.array([left]))[0]), abs=1e-9)


@pytest.mark.promise("gallery-2", "gallery-3", "report-6")
def test_the_page_and_the_verdict_say_which_of_them_turn_it(found):
    study = plain_study()
    (said,) = words.read_otherwise(study)
    turned = [f"{key} = {other}" for (key, other), r in found.items() if r.margin_db < 0.0]
    assert study.achieved.margin_db > 0.0 and len(turned) == 5
    assert all(each in said for each in turned) and "optical" not in said
    assert said in " ".join(report.verdict_text(study, verbose=True).split())
    rows = {(r[0].text, r[2]): r for r in requirement_views.readings_table(study).rows}
    assert rows["as it stands", ""][5] == "yes" and rows["as it stands", ""][6].mark == "FAIL"
    assert rows["mirror.composition", "additive"][5] == "no"
    assert rows["requirement.residual_statistic", "rms"][6].mark == "PASS"


def test_no_reading_passes_on_a_mirror_without_dynamics(monkeypatch):
    study = plain_study()
    marks = [r[6].mark for r in requirement_views.readings_table(study).rows]
    assert "PASS" in marks
    monkeypatch.setattr(requirement_views, "unknown", lambda mission: "dynamics")
    assert {r[6].mark for r in requirement_views.readings_table(study).rows} == {"FAIL"}


def test_a_loop_that_cannot_be_run_so_says_why(monkeypatch):
    study = plain_study()

    def unstable(*given):
        raise ValueError("the loop is unstable")

    monkeypatch.setattr(readings.paper_cases, "sine_runs", unstable)
    made = {(r.key, r.other): r for r in readings.other_readings(study.file.mission, study.residual)}
    failed = made["mirror.composition", "additive"]
    assert failed.failure == "the loop is unstable" and math.isnan(failed.residual_rad) and not failed.closes
    assert made["conventions.residual", "radial"].failure == ""


def test_each_reading_is_judged_by_its_own_conventions_on_the_run_that_it_asks_for(tmp_path, monkeypatch):
    """Of a mission with neither default: rms, radial; the loop runs anew for readings of the mirror alone."""
    m = edited(
        tmp_path,
        ('residual = "per-axis"', 'residual = "radial"'),
        ('statistic = "peak"', 'statistic = "rms"'),
        ('strehl = "decibel"', 'strehl = "ratio"'),
    )
    read = readings.paper_cases

    def left(q, conventions, trace):
        asked.append((q.residual_statistic, conventions.residual, trace))
        return float(len(asked))

    asked, linked = [], []
    monkeypatch.setattr(readings.mirror, "of", lambda of: of.conventions.mirror_angle)
    monkeypatch.setattr(read, "of", lambda of, parts: (of.mirror.composition, parts))
    monkeypatch.setattr(readings, "_largest", lambda cases, statistic: SimpleNamespace(trace=(*cases, statistic)))
    monkeypatch.setattr(read, "residual_rad", left)
    monkeypatch.setattr(readings.link, "of", lambda of: (of.conventions.pointing_loss, of.conventions.strehl))
    monkeypatch.setattr(readings.link, "margin_of_error", lambda data, error: linked.append((data, error)) or -error)
    made = readings.other_readings(m, SimpleNamespace(trace="own"))
    assert [(r.key.partition(".")[2], r.given, r.other) for r in made] == [
        ("residual", "radial", "per-axis"),
        ("pointing_loss", "gaussian", "gain"),
        ("strehl", "ratio", "decibel"),
        ("mirror_angle", "line-of-sight", "optical"),
        ("mirror_angle", "line-of-sight", "mechanical"),
        ("residual_statistic", "rms", "peak"),
        ("composition", "cascade", "additive"),
    ]
    assert asked == [
        ("rms", "per-axis", "own"),
        ("rms", "radial", "own"),
        ("rms", "radial", "own"),
        ("rms", "radial", ("cascade", "optical", "rms")),
        ("rms", "radial", ("cascade", "mechanical", "rms")),
        ("peak", "radial", "own"),
        ("rms", "radial", ("additive", "line-of-sight", "rms")),
    ]
    links = [("gaussian", "ratio"), ("gain", "ratio"), ("gaussian", "decibel"), *[("gaussian", "ratio")] * 4]
    assert linked == [(data, place) for place, data in enumerate(links, 1)]
    assert [(r.residual_rad, r.margin_db, r.failure) for r in made] == [(k, -k, "") for k in range(1, 8)]


def test_the_largest_run_is_one_of_those_on_the_missions_own_mirror(monkeypatch):
    monkeypatch.setattr(tracking, "sine_runs", lambda cases, variants: [(cases, v) for v in variants])
    monkeypatch.setattr(tracking, "worst", lambda runs, statistic: (statistic, *runs))
    assert readings._largest("cases", "rms") == ("rms", ("cases", readings.Variant.GIVEN))
