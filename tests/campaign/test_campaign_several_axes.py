"""Campaigns that draw the mirror of several axes in their loop from the covariance of its file."""

import math
import os
from contextlib import closing
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from campaign_files import HEAD, IDENTIFIED, POWER
from microrad.campaign import run
from microrad.campaign.file import load_campaign
from microrad.campaign.ledger import Ledger
from microrad.campaign.rows import evaluate, loops, sampling
from microrad.campaign.rows.evaluator import Evaluator
from microrad.campaign.rows.missions import MissionBuilder
from microrad.loop.pointing_loop import ensemble, traces
from microrad.mirror import coupled
from microrad.mirror.hysteresis import BoucWen
from microrad.mission.file import MissionError
from several_axes import TEXT, mission_text, two_axes
from small_campaign import without_worker

NAMED = ("[fine_pointing]\n", '[fine_pointing]\nmirror_file = "mirror.toml"\n')
LOOP = '[loop]\ncontroller = "PI"\nduration = "0.2 s"\nsettle = "0.1 s"\n'
SMALL = HEAD.replace("runs = 256", "runs = 12").replace("sobol", "random")
SIGMAS = 4.5
WITHOUT = TEXT[: TEXT.index("[uncertainty]")]
MANY = SMALL.replace("runs = 12", "runs = 4000")


def written(folder, text, mirror=TEXT):
    (folder / "mirror.toml").write_text(mirror, encoding="utf-8")
    (folder / "mission.toml").write_text(mission_text(NAMED), encoding="utf-8")
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder / "campaign.toml"


def loaded(folder, text, mirror=TEXT):
    return load_campaign(written(folder, text, mirror))


def drawn_mirrors(campaign, count, cell=0):
    columns, _ = sampling.rows(campaign, cell, 0, count)
    builder = MissionBuilder(campaign)
    rows = ({key: float(column[i]) for key, column in columns.items()} for i in range(count))
    return [builder.several_axes(cell, values) for values in rows]


def known_values(mirror):
    """The four parameters that the page's mirror is known in."""
    own = mirror.mirror
    return -own.A[0, 0], own.A[1, 0], own.plays[0].weights_rad_v[2], mirror.delay_s


def same(one, other):
    """Whether two mirrors have the same numbers."""
    matrices = all(np.array_equal(getattr(one.mirror, name), getattr(other.mirror, name)) for name in "ABCDEFGK")
    return matrices and one.mirror.bank == other.mirror.bank and one.delay_s == other.delay_s


@pytest.mark.promise("campaigns-14")
def test_the_columns_of_a_row_are_the_numbers_that_move_its_mirror(tmp_path):
    campaign = loaded(tmp_path, MANY + LOOP + IDENTIFIED + POWER)
    names = [f"mirror.{number}" for number in range(1, 5)]
    assert [each.key for each in campaign.inputs] == [*names, "communication.transmit_power"]
    assert campaign.inputs[2].distribution == "identified, 3 of 4 standard normal numbers for 4 parameters"
    assert campaign.loop_varies and campaign.realisations == 64
    columns, weight = sampling.rows(campaign, 0, 0, 3)
    assert np.all(weight == 1.0)
    known = two_axes().known
    for row, mirror in enumerate(drawn_mirrors(campaign, 3)):
        normals = np.array([columns[name][row] for name in names])
        wanted = np.array(known_values(two_axes())) + known.standard_errors * (known.factor @ normals)
        np.testing.assert_allclose(known_values(mirror), wanted, rtol=1e-12)
        assert mirror.known is None


@pytest.mark.promise("campaigns-13", "campaigns-14")
@pytest.mark.promise("pointing-77")
def test_drawn_rows_follow_the_covariance_of_the_file(tmp_path):
    """Mean and covariance as close as so many independent rows tell them: SIGMAS standard errors."""
    rows = 4000
    campaign = loaded(tmp_path, MANY + LOOP + IDENTIFIED)
    values = np.array([known_values(mirror) for mirror in drawn_mirrors(campaign, rows)])
    known = two_axes().known
    off = (values - known_values(two_axes())) / known.standard_errors
    assert np.all(np.abs(off.mean(axis=0)) < SIGMAS / math.sqrt(rows))
    wanted = known.correlation
    bound = SIGMAS * np.sqrt((1.0 + wanted**2) / rows)
    assert np.all(np.abs(off.T @ off / rows - wanted) < bound)
    assert np.max(np.abs(wanted - np.eye(4))) > 5.0 * np.max(bound)  # and a diagonal would not do


def test_the_same_seed_repeats_a_row_whoever_asks_for_it(tmp_path):
    campaign = loaded(tmp_path, HEAD + LOOP + IDENTIFIED)
    whole, _ = sampling.rows(campaign, 0, 0, 64)
    for row in (0, 17, 63):
        alone, _ = sampling.rows(campaign, 0, row, 1)
        assert {key: column[row] for key, column in whole.items()} == {key: c[0] for key, c in alone.items()}
    again, _ = sampling.rows(loaded(tmp_path, HEAD + LOOP + IDENTIFIED), 0, 0, 64)
    other, _ = sampling.rows(loaded(tmp_path, HEAD.replace("seed = 1", "seed = 2") + LOOP + IDENTIFIED), 0, 0, 64)
    for key, column in whole.items():
        assert np.array_equal(again[key], column)
        assert not np.any(other[key] == column)


def test_without_a_draw_the_mirror_is_that_of_the_file_to_the_digit(tmp_path):
    campaign = loaded(tmp_path, SMALL + LOOP + POWER)
    assert MissionBuilder(campaign).several_axes(0, {"communication.transmit_power": 5.0}) is None
    assert same(coupled.moved(two_axes(), np.zeros(4)), two_axes())
    drawn = loaded(tmp_path, SMALL + LOOP + IDENTIFIED + POWER)
    nominal, moved = (loops.mission_loop(c.cells[0].file, c.table.loop, 1) for c in (campaign, drawn))
    assert np.array_equal(nominal.row.mirror.A, moved.row.mirror.A)
    assert same(replace(two_axes(), mirror=nominal.row.mirror), two_axes())


@pytest.mark.promise("campaigns-6", "campaigns-19")
def test_a_row_flies_the_drawn_mirror_under_the_controller_of_the_nominal_one(tmp_path):
    campaign = loaded(tmp_path, SMALL + LOOP + IDENTIFIED)
    tuned = dict(enumerate(loops.controllers(campaign, lambda *_: None)))
    nominal = loops.mission_loop(campaign.mission, campaign.table.loop, campaign.table.seed)
    evaluator = Evaluator(campaign, tuned)
    assert np.array_equal(evaluator.controller(0).system.A, nominal.controller(tuned[0]).system.A)
    chunk = evaluator.rows(0, range(2), lambda: None)
    assert not chunk.failed
    for row, mirror in enumerate(drawn_mirrors(campaign, 2)):
        flown = replace(nominal.row, mirror=mirror.mirror)
        each = campaign.realisations
        runs = ensemble.simulate(flown, nominal.controller(tuned[0]), nominal.span, each, first_run=row * each)
        wanted = evaluate.outputs(campaign.mission, runs, chunk.columns)
        assert {name: chunk.columns[name][row] for name in wanted} == wanted
    seen = evaluator.trace(0, 1, lambda: None)  # the first run of that row
    run_of = [traces.trace(flown, nominal.controller(tuned[0]), nominal.span, number) for number in (each, 1)]
    first, other = (run.error_rad[run.time_s >= nominal.span.settle_s] for run in run_of)
    assert np.array_equal(seen.error_rad, first) and not np.array_equal(seen.error_rad, other)
    rms = chunk.columns["residual_rms"]
    assert rms[0] != rms[1]
    flat = Evaluator(loaded(tmp_path, SMALL + LOOP + POWER), tuned).rows(0, range(1), lambda: None)
    assert flat.columns["residual_rms"][0] not in rms


@pytest.mark.endurance
def test_the_rows_are_the_same_by_two_workers_and_by_none(tmp_path, monkeypatch):
    """Here by one; `make endurance` begins both, as another file does for a mirror of one axis."""
    path, found = written(tmp_path, SMALL + LOOP + IDENTIFIED), []
    threads = 2 if os.environ.get("MICRORAD_ENDURANCE") else 1
    for name in ("two", "none"):
        book = tmp_path / f"{name}.ledger"
        if name == "none":
            without_worker(monkeypatch)
        run.run_campaign(path, book, run.Means(threads=threads))
        with closing(Ledger.open(book, write=False)) as ledger:
            found.append({chunk.number: chunk for chunk in ledger.chunks(0)})
    two, none = found
    assert none.keys() == two.keys() and len(none) > 1
    for number, chunk in none.items():
        assert not chunk.failed
        for name, column in chunk.columns.items():
            assert np.array_equal(column, two[number].columns[name]), name


@pytest.mark.promise("campaigns-15")
def test_a_mirror_that_runs_away_is_drawn_again_and_a_weight_is_at_least_0(tmp_path):
    wide = TEXT.replace("standard_errors = [0.4, 0.9, 0.004,", "standard_errors = [0.4, 0.9, 0.6,")
    assert wide != TEXT
    campaign = loaded(tmp_path, MANY + LOOP + IDENTIFIED, wide)
    weights = np.array([known_values(mirror)[2] for mirror in drawn_mirrors(campaign, 400)])
    assert np.min(weights) == 0.0
    assert 0.4 < np.mean(weights == 0.0) < 0.75  # more than half: some of those above 0 run away
    assert np.max(weights) < 1.0


def test_a_bouc_wen_model_without_bound_is_drawn_again():
    mirror = two_axes()
    model = BoucWen(0.02, 0.0, 0.01, 0.0, 2.0, 1.9)
    own = replace(mirror.mirror, bouc_wen=(model,), plays=mirror.mirror.plays[1:])
    known = replace(
        mirror.known,
        parameters=("hysteresis.1.alpha",),
        standard_errors=np.array([0.5]),
        factor=np.ones((1, 1)),
    )
    drawn = coupled.draws(replace(mirror, mirror=own, known=known), 50, 1)
    alphas = np.array([each.mirror.bouc_wen[0].alpha_1_v for each in drawn])
    assert np.all(alphas > 1.9)
    assert np.unique(alphas).size == 50


ONE_AXIS = 'name = "one"\ntravel = "2 mrad"\n'
LISTED = '[inputs."fine_pointing.mirror_file"]\ndistribution = "table"\nvalues = ["mirror.toml", "other.toml"]\n'


@pytest.mark.parametrize(
    ("mirror", "more", "said"),
    [
        (WITHOUT, "", 'the mirror "Two axes on a hysteretic spring" has no table uncertainty'),
        (ONE_AXIS, "", "a mirror of one axis"),
        (None, "", "does not exist"),
        (TEXT, LISTED, r"\[inputs.mirror\] draws the mirror that it names"),
    ],
)
def test_what_cannot_be_drawn_is_refused(tmp_path, mirror, more, said):
    path = written(tmp_path, SMALL + LOOP + IDENTIFIED + more, mirror or "")
    (tmp_path / "other.toml").write_text(TEXT, encoding="utf-8")
    if mirror is None:
        (tmp_path / "mirror.toml").unlink()
    with pytest.raises(MissionError, match=said):
        load_campaign(path)


def test_an_uncertainty_that_leaves_no_mirror_is_refused_where_the_campaign_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(coupled.spread, "is_one", lambda mirror: False)
    with pytest.raises(MissionError, match="1000 draws from the uncertainty of") as caught:
        loaded(tmp_path, SMALL + LOOP + IDENTIFIED)
    assert [fault.key for fault in caught.value.faults] == ["inputs.mirror"]


@pytest.mark.promise("campaigns-13")
def test_a_mirror_of_each_cell_has_its_own_covariance(tmp_path):
    """Of a cell that is known in fewer directions the other numbers are left empty."""
    fewer = WITHOUT + (
        '[uncertainty]\nparameters = ["modes.decay.1", "modes.frequency.1"]\nstandard_errors = [0.4, 0.9]\n'
    )
    path = written(
        tmp_path, SMALL + LOOP + IDENTIFIED + '[grid]\n"fine_pointing.mirror_file" = ["mirror.toml", "f.toml"]\n'
    )
    (tmp_path / "f.toml").write_text(fewer, encoding="utf-8")
    campaign = load_campaign(path)
    assert [len(cell.directions) for cell in campaign.cells] == [4, 2]
    columns, _ = sampling.rows(campaign, 1, 0, 12)
    assert [bool(np.all(np.isnan(columns[f"mirror.{n}"]))) for n in range(1, 5)] == [False, False, True, True]
    for mirror in drawn_mirrors(campaign, 12, 1):
        decay, frequency, *rest = known_values(mirror)
        assert decay != 18.0 and frequency != 900.0 and tuple(rest) == known_values(two_axes())[2:]


@pytest.mark.parametrize("order", ['"f.toml", "mirror.toml"', '"mirror.toml", "f.toml"'])
def test_the_numbers_of_a_row_are_told_by_the_first_mirror_that_has_them(tmp_path, order):
    """Two cells, one known in two directions and one in four, either way round."""
    fewer = WITHOUT + (
        '[uncertainty]\nparameters = ["modes.decay.1", "modes.frequency.1"]\nstandard_errors = [0.4, 0.9]\n'
    )
    path = written(tmp_path, SMALL + LOOP + IDENTIFIED + f'[grid]\n"fine_pointing.mirror_file" = [{order}]\n')
    (tmp_path / "f.toml").write_text(fewer, encoding="utf-8")
    few = 2 if order.startswith('"f') else 4
    assert [(each.key, each.unit, each.distribution) for each in load_campaign(path).inputs] == [
        (f"mirror.{number}", "", f"identified, {number} of {of} standard normal numbers for {of} parameters")
        for number, of in ((1, few), (2, few), (3, 4), (4, 4))
    ]


def test_the_mirror_of_the_second_cell_has_to_be_known_too(tmp_path):
    path = written(
        tmp_path, SMALL + LOOP + IDENTIFIED + '[grid]\n"fine_pointing.mirror_file" = ["mirror.toml", "w.toml"]\n'
    )
    (tmp_path / "w.toml").write_text(WITHOUT.replace("Two axes", "Another two axes"), encoding="utf-8")
    with pytest.raises(MissionError) as caught:
        load_campaign(path)
    assert [fault.key for fault in caught.value.faults] == ["inputs.mirror"]
    assert 'the mirror "Another two axes on a hysteretic spring" has no table uncertainty' in str(caught.value)


def bare(kind, **values):
    """A scene with these values alone."""
    made = object.__new__(kind)
    for name, value in values.items():
        object.__setattr__(made, name, value)
    return made


@pytest.mark.parametrize(("name", "tuned"), [("PI", "PI"), ("PI + feedforward", "PI"), ("LQG", "LQG")])
def test_the_controller_of_several_axes_is_the_whole_feedback_of_the_named_one(monkeypatch, name, tuned):
    asked = []

    def design(scene, only):
        asked.append((scene, only))
        return SimpleNamespace(made=[SimpleNamespace(controller=SimpleNamespace(system="A", anti_windup="L"))])

    monkeypatch.setattr(loops.coupled_study, "design", design)
    scene = bare(loops.coupled_study.CoupledScene, table=SimpleNamespace(seed=5))
    found = loops.MissionLoop(SimpleNamespace(controller=name), scene, "row", "span").tuned()
    assert (found.name, found.system, found.anti_windup) == (name, "A", "L")
    assert asked == [(scene, (tuned,))]


def test_the_controller_of_one_axis_is_tuned_for_the_plants_of_the_missions_seed(monkeypatch):
    study = loops.controller_study
    monkeypatch.setattr(study, "plants", lambda scene, seed: ("plants", scene, seed))
    monkeypatch.setattr(study, "tune", lambda *given: SimpleNamespace(controller=given))
    table = SimpleNamespace(seed=5)
    scene = bare(study.Scene, table=table)
    found = loops.MissionLoop(SimpleNamespace(controller="PI"), scene, "row", "span").tuned()
    assert found == ("PI", table, ("plants", scene, 5))
