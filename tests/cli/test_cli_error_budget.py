"""The budget of `microrad pointing`: a mission's table, a list beside it, its own loop, and the exit code."""

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from budget_files import LIST, TABLE
from microrad.cli import error_budget as cli_budget
from microrad.cli.frame import Refusal
from microrad.link.error_budget import ErrorSource, Requirement, Spread, budget
from microrad.loop.disturbance.windows import ErrorIndex
from shipped import SHIPPED, without_fine_pointing


@pytest.fixture
def mission(tmp_path):
    """A mission without a loop, with a budget of two sources, and a list of one beside it."""
    (tmp_path / "errors.csv").write_text(LIST, "utf-8")
    path = tmp_path / "m.toml"
    path.write_text(without_fine_pointing(SHIPPED.read_text("utf-8")) + TABLE, "utf-8")
    return path


def changed(path, *changes):
    text = path.read_text("utf-8")
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    path.write_text(text, "utf-8")


@pytest.mark.promise("readme-5")
@pytest.mark.promise("pointing-44", "pointing-56", "pointing-63")
def test_the_table_and_the_list_are_the_engine_s_budget(call, mission, tmp_path):
    code, out, _ = call("pointing", str(mission), "--sources", str(tmp_path / "errors.csv"), "--json")
    found = {each["requirement"]: each for each in json.loads(out)["budget"]}
    sources = (
        ErrorSource("alignment", "constant", Spread("gaussian", 0.0, 2e-6 / 3.0), np.array([1.0, 0.5])),
        ErrorSource("thermo_elastic", "periodic", Spread("fixed", 1.5e-6), np.array([0.0, 1.0]), freq_hz=2e-4),
        ErrorSource("star tracker", "random", Spread("fixed", 1e-6), np.ones(2), apart=True),
    )
    wanted = budget(sources, (Requirement(ErrorIndex("RPE", 0.01)), Requirement(ErrorIndex("APE"), 0.95, axes=(1,))))
    for each, name in zip(wanted, ("code_word", "drift"), strict=True):
        assert found[name]["by_distribution_rad"] == pytest.approx(each.quantile_rad, rel=1e-9, abs=0.0)
        assert found[name]["by_rules_rad"] == pytest.approx(each.by_rules_rad, rel=1e-9, abs=0.0)
    assert found["code_word"]["by_distribution_rad"] == pytest.approx(
        1e-6 * math.sqrt(-2.0 * math.log(1.0 - 0.9973)), rel=1e-6, abs=0.0
    )  # of the star tracker alone: Rayleigh
    assert (found["code_word"]["holds"], found["drift"]["holds"], code) == (True, False, 1)
    origins = {each["name"]: each["origin"] for each in found["drift"]["sources"]}
    assert origins == {
        "alignment": "assumption: calibrated on the ground",
        "thermo_elastic": origins["thermo_elastic"],
        "star tracker": "data sheet",
    }
    assert "line" in origins["thermo_elastic"]


@pytest.mark.promise("pointing-63")
def test_the_tables_fit_a_terminal_and_say_what_is_kept_and_what_weighs(call, mission):
    changed(mission, ('limit = "2 urad"', 'limit = "4 urad"'))
    code, out, _ = call("pointing", str(mission))
    assert code == 0
    assert max(map(len, out.splitlines())) <= 80
    for words in (
        "Requirements, µrad",
        "99.73 % of the time",
        "PASS",
        "alignment",
        "times",
        "By the rules: abs(mean)",
    ):
        assert words in out


def test_a_list_alone_is_taken_in_the_windows_that_are_asked_for(call, mission, tmp_path):
    mission.write_text(without_fine_pointing(SHIPPED.read_text("utf-8")), "utf-8")
    options = ("--sources", str(tmp_path / "errors.csv"), "--window", "1 s", "--spacing", "1 min", "--json")
    code, out, _ = call("pointing", str(mission), *options)
    found = json.loads(out)["budget"]
    assert code == 0
    assert [each["index"] for each in found] == ["APE", "MPE", "RPE", "PDE"]
    assert [each["holds"] for each in found] == [None] * 4
    assert found[0]["by_distribution_rad"] == found[2]["by_distribution_rad"] > found[1]["by_distribution_rad"] == 0.0


@pytest.mark.promise("pointing-45", "pointing-47", "pointing-61")
def test_what_the_loop_leaves_is_a_source_of_its_window(call, tmp_path):
    path = tmp_path / "m.toml"
    path.write_text(SHIPPED.read_text("utf-8") + TABLE.replace("with_loop = false", "with_loop = true"), "utf-8")
    _, out, _ = call("pointing", str(path), "--window", "10 ms", "--json")
    document = json.loads(out)
    left = next(each for each in document["indices"] if each["index"] == "RPE")["left_rad"]
    word = next(each for each in document["budget"] if each["requirement"] == "code_word")
    loop = [each for each in word["sources"] if each["class"] == "loop"]
    assert math.hypot(*(value for each in loop for value in each["sigma_rad"])) == pytest.approx(
        left["all"], rel=1e-9, abs=0.0
    )
    assert {each["name"] for each in loop} == set(left) - {"all"}
    assert {each["origin"] for each in loop} == {"the mission's fine-pointing loop under PI"}


SOURCES, REQUIREMENTS = (
    TABLE[TABLE.index(first) : TABLE.index(behind) if behind else None]
    for first, behind in (
        ("[error_budget.sources.alignment]", "[error_budget.requirements.code_word]"),
        ("[error_budget.requirements.code_word]", None),
    )
)


@pytest.mark.promise("pointing-53")
@pytest.mark.parametrize(
    ("changes", "options", "words"),
    [
        ([], ("--sources", "none.csv"), "none.csv: cannot be read"),
        (
            [("sources.alignment]", 'sources."star tracker"]')],
            ("--sources", "errors.csv"),
            'errors.csv: "star tracker" is a source',
        ),
        ([('window = "10 ms"\n', "")], (), 'is missing, and index = "RPE" needs it'),
        ([('index = "APE"', 'index = "APE"\nwindow = "1 s"')], (), 'does not belong to index = "APE"'),
        ([("with_loop = false", "with_loop = true"), ('index = "APE"', 'index = "AKE"')], (), "is of what is known"),
        ([("gains = [1.0, 0.5]", "gains = []")], (), "error_budget.sources.alignment.gains"),
        ([("gains = [1.0, 0.5]", "gains = [1, 1, 1, 1]")], (), "has 4 items"),
        ([(SOURCES, "")], (), "error_budget.sources\n    holds no source"),
        ([(REQUIREMENTS, "[error_budget.requirements]\n")], (), "error_budget.requirements\n    holds none"),
        (
            [
                ("with_loop = false", "with_loop = true"),
                ("gains = [1.0, 0.5]", "gains = [1, 1, 0]"),
                ("gains = [0.0, 1.0]", "gains = [0, 1, 0]"),
            ],
            (),
            "has two axes, and the sources have 3",
        ),
        ([('axes = "y"', 'axes = "z"')], (), "needs 3 axes, and the sources have 2"),
        ([("gains = [0.0, 1.0]", "gains = [1.0]")], (), "has 1 item, and others have 2"),
        ([('frequency = "0.2 mHz"', 'period = "1 h"')], (), 'is missing, and class = "periodic" needs it'),
        (
            [('index = "APE"', 'index = "PDE"\nwindow = "1 s"\nspacing = "9 s"\nobservation = "9 s"')],
            (),
            "PDE: both windows have to lie in the observation period of 9 s",
        ),
    ],
)
def test_what_is_no_budget_is_refused(refused, mission, changes, options, words):
    changed(mission, *changes)
    assert words in refused("pointing", "m.toml", *options)


@pytest.mark.promise("pointing-63")
@pytest.mark.parametrize(
    "line",
    ['index = "RPE"', "confidence = 0.9973", 'axes = "radial"', 'limit = "4 urad"', 'interpretation = "temporal"'],
)
def test_nothing_of_a_requirement_has_a_default(refused, mission, line):
    head, behind = mission.read_text("utf-8").split("[error_budget.requirements.code_word]")
    mission.write_text(f"{head}[error_budget.requirements.code_word]{behind.replace(line, '', 1)}", "utf-8")
    words = refused("pointing", "m.toml")
    assert f"error_budget.requirements.code_word.{line.partition(' ')[0]}" in words and "missing" in words


@pytest.mark.promise("pointing-47")
def test_a_list_beside_the_mission_is_no_part_of_a_run(refused, mission):
    assert "No such option: --sources" in refused("run", "m.toml", "--sources", "errors.csv")


@pytest.mark.promise("pointing-60")
@pytest.mark.endurance
def test_a_correlation_of_the_table_makes_one_line_of_two_sources(call, mission):
    more = TABLE[TABLE.index("[error_budget.sources.alignment]") : TABLE.index("[error_budget.sources.thermo")]
    again = more.replace("sources.alignment", "sources.mounting")
    link = '[error_budget.correlations.bench]\nfirst = "alignment"\nsecond = "mounting"\ncoefficient = 1.0\n'
    mission.write_text(mission.read_text("utf-8") + again + link, "utf-8")
    changed(mission, ('confidence = 0.95\ninterpretation = "temporal"', 'confidence = 0.95\ninterpretation = "mixed"'))
    _, out, _ = call("pointing", str(mission), "--json")
    found = {each["requirement"]: each for each in json.loads(out)["budget"]}["drift"]
    joined = next(each for each in found["sources"] if "with" in each["name"])
    assert joined["name"] == "alignment with mounting"
    assert joined["origin"].count("calibrated on the ground") == 2
    assert joined["sigma_rad"] == [pytest.approx(2e-6 / 3.0, rel=1e-9, abs=0.0)]  # 2 of them, times a gain of a half


def test_a_loop_that_is_asked_for_and_not_there_is_refused(refused, mission):
    changed(mission, ("with_loop = false", "with_loop = true"))
    told = refused("pointing", "m.toml")
    assert "error_budget.with_loop = true" in told
    assert "expected: the table [fine_pointing], which microrad init writes, or false" in told


@pytest.mark.parametrize(
    ("index", "observed_s"),
    [(("APE",), None), (("RPE", 0.25), None), (("PDE", 0.25, 60.0), 60.25), (("PDE", 4.0, 7.5), 11.5)],
)
def test_a_list_alone_is_observed_over_both_windows_of_a_difference(index, observed_s):
    assert cli_budget._observed(ErrorIndex(*index)) == observed_s


def test_of_several_sources_that_are_given_twice_the_first_by_name_is_told(monkeypatch):
    from microrad.link.error_budget import assembly
    from microrad.mission import source_list

    own = SimpleNamespace(sources=[SimpleNamespace(name=n) for n in ("zeta", "beta", "own")], required={})
    monkeypatch.setattr(assembly, "of_mission", lambda table, sources: own)
    monkeypatch.setattr(assembly, "source_of", lambda name, source, origin: SimpleNamespace(name=name))
    monkeypatch.setattr(assembly, "stated", lambda sources, required, table=None: [each.name for each in sources])
    listed = ["zeta", "new", "beta"]
    monkeypatch.setattr(
        source_list, "read_sources", lambda path: [SimpleNamespace(name=n, source=0, origin=0) for n in listed]
    )
    mission = SimpleNamespace(mission=SimpleNamespace(error_budget="table"), sources={}, path="m.toml")
    with pytest.raises(Refusal) as refusal:
        cli_budget.stated_beside(mission, Path("list.csv"), [])
    assert str(refusal.value) == 'list.csv: "beta" is a source of m.toml, too: give it once'
    listed[:] = ["new", "other"]
    assert cli_budget.stated_beside(mission, Path("list.csv"), []) == ["zeta", "beta", "own", "new", "other"]
    assert cli_budget.stated_beside(mission, None, []) is own
