"""The ladder: what is fitted to what, the choice on samples that no fit has seen, its doubts, and the mirror file."""

import pickle
import re
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import truths
from microrad.core import kernels, lti
from microrad.lab import bench
from microrad.lab import identify as identification
from microrad.lab.bench.play import play_records, true_output
from microrad.lab.identify import (
    FORMS,
    MODELS,
    STATIC,
    IdentificationError,
    JointFit,
    Units,
    fit_bouc_wen,
    fit_joint,
    identify,
    mirror_file_text,
    predict,
)
from microrad.lab.identify.hysteresis.alone import STATIC_FORMS
from microrad.lab.identify.hysteresis.structures import LinearPoles, Roots, poles_of
from microrad.lab.identify.records import si_records
from microrad.lab.identify.selection import candidates, choice, predictions
from microrad.lab.identify.selection.candidates import refit
from microrad.lab.identify.selection.choice import choose_best
from microrad.lab.identify.statistics import correlation, propagated
from microrad.lab.recording import Recording
from microrad.lab.recording.reader import recording_from_arrays
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii
from microrad.mission.file import load_mirror
from microrad.report.identification.parameters import parameter_rows
from places import ROOT
from truths import behind_resonance, bouc_wen, philox, plays, recorded, small_multisine
from waiting import no_hang

PAGE = (ROOT / "docs" / "identify.md").read_text(encoding="utf-8")
RATE = 4000.0
THRESHOLDS, WEIGHTS = (0.0, 0.6, 1.9), (6e-5, 1.5e-5, 1e-5)
FEW = ("prandtl_ishlinskii", "linear", "prandtl_ishlinskii_joint")


def truth(drive):
    """What a converter holds, behind plays and a resonance."""
    return behind_resonance(plays(drive, THRESHOLDS, WEIGHTS), RATE, held=True)


def loop(freq_hz, seed=0, samples=6000, amplitude=1.0):
    drive = 5.0 + amplitude * (truths.two_sines(samples, RATE, freq_hz) - 5.0)
    return recorded(drive, truth(drive), RATE, seed=seed, name=f"loop-{freq_hz:g}hz")


@pytest.fixture(scope="module")
def wide():
    drive = small_multisine(RATE, 4000, 2)
    return recorded(drive, truth(drive), RATE, noise=3e-3, name="wide", period=4000)


@pytest.fixture(scope="module")
def loops():
    return [loop(2.0), loop(12.0, seed=1)]


@pytest.fixture(scope="module", autouse=True)
def linear_part_once():
    """The linear part of the same recordings is found once: all that is compared here is fitted behind it."""
    fit_axis, found = candidates.fit_axis, {}

    def known(records, *, on_progress, **options):
        key = pickle.dumps(([(r.drive, r.output, r.rate_hz, r.period_samples) for r in records], options))
        if key not in found:
            heard = []
            found[key] = fit_axis(records, on_progress=lambda *args: heard.append(args), **options), heard
        fit, heard = found[key]
        for args in heard:
            on_progress(*args)
        return fit

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candidates, "fit_axis", known)
        yield


@pytest.fixture(scope="module")
def told():
    """The progress of `found`."""
    return []


@pytest.fixture(scope="module")
def found(loops, wide, told):
    return identify([wide, *loops], models=FEW, on_progress=lambda *args: told.append(args))


@pytest.fixture
def unpolished(monkeypatch):
    """The winner stays as it is found, where only the candidates matter: that polishes no loops once more."""
    monkeypatch.setattr(choice, "refit", lambda candidates, winner, predictions, *rest: (winner, predictions))


def numbers(fit):
    """Everything that a fit found, to be compared exactly."""
    if isinstance(fit, JointFit):
        return [fit.fit.values, fit.fit.covariance]
    return [getattr(fit, name) for name in ("values", "covariance", "weights_rad_per_v") if hasattr(fit, name)]


# -------------------------------------------------------------------------------------------------------------- choice
@pytest.mark.promise("choose-2")
@pytest.mark.promise("identify-1", "identify-11")
def test_the_model_of_the_truth_is_chosen(found):
    assert found.chosen == "prandtl_ishlinskii_joint"
    assert [s.model for s in found.scores] == list(FEW)
    by_name = {s.model: s for s in found.scores}
    assert 0.09 < by_name["prandtl_ishlinskii_joint"].held_out_rms_percent < 0.12  # the noise is 0.1 %
    assert (
        by_name["prandtl_ishlinskii"].held_out_rms_percent
        > 5 * by_name["prandtl_ishlinskii_joint"].held_out_rms_percent
    )
    assert by_name["linear"].held_out_rms_percent > 5 * by_name["prandtl_ishlinskii_joint"].held_out_rms_percent
    for score in (by_name["prandtl_ishlinskii"], by_name["linear"]):
        assert f"{score.held_out_rms_percent:.3g} % by {score.model}" in found.reason
    assert f"{found.straight_line.held_out_rms_percent:.3g} % by a straight line" in found.reason
    assert found.refused == ()


@pytest.mark.promise("identify-3", "identify-8")
@pytest.mark.promise("readme-9")
@pytest.mark.promise("identify-54")
def test_what_each_recording_served_for(found):
    assert [(s.path, s.role, s.fitted, s.held_out) for s in found.sources] == [
        ("loop-2hz", "loops", 3000, 3000),
        ("loop-12hz", "loops", 3000, 3000),
        ("wide", "broadband", 8000, 0),
    ]
    assert len(found.recordings) == len(found.predictions[0]) == 2
    static = identify([found.recordings[0]], models=("prandtl_ishlinskii",))
    assert static.linear is None


@pytest.mark.promise("identify-3")
@pytest.mark.usefixtures("unpolished")
def test_a_broadband_record_that_no_fit_used_is_said_to_be_unused(loops, wide):
    slower = replace(wide, path="slower", rate_hz=2000.0)
    result = identify([wide, slower, loops[0]], models=("prandtl_ishlinskii_joint",))
    assert {s.path: s.fitted for s in result.sources} == {"loop-2hz": 3000, "wide": 8000, "slower": 0}
    without = identify([wide, loops[0]], models=("prandtl_ishlinskii",))
    assert {s.path: s.fitted for s in without.sources} == {"loop-2hz": 3000, "wide": 0}


@pytest.mark.promise("identify-10", "identify-12")
def test_the_winner_is_polished_with_everything_free(loops, monkeypatch):
    """From poles that are off, to those of the truth; the broadband record belongs to that fit."""
    off = LinearPoles(Roots((153.0,), (0.33,)), Roots((), ()), 3.0)
    monkeypatch.setattr(candidates, "poles_of", lambda *_: off)
    drive = small_multisine(RATE, 4000, 2)
    wide = recorded(drive, truth(drive), RATE, noise=3e-3, name="wide", period=4000)
    result = identify([wide, *loops], models=("linear", "prandtl_ishlinskii_joint"))
    names = [p.name for p in result.fit().structure.parameters]
    values = dict(zip(names, result.fit().fit.values, strict=True))
    assert values["pole 1"] == pytest.approx(150.0, rel=0.01)
    assert values["pole 1 damping"] == pytest.approx(0.35, rel=0.02)
    assert result.fit("linear").linear.poles == off.poles
    error = result.fit().fit.standard_errors[names.index("pole 1")]
    text = mirror_file_text(result, "m")
    assert f"± standard error {error:.2g} Hz, from wide" in text
    assert "(broadband): 8000 samples fitted" in text
    (told,) = [
        line for line in text.splitlines() if line.startswith("# recording: drive held between samples, output ")
    ]
    assert "± " in told and told.endswith(
        " late, a delay that belongs to the recording chain and is no part of the mirror"
    )
    assert "delay" in [row.name for row in parameter_rows(result.fit())]  # which are those of the report


@pytest.mark.promise("identify-10", "identify-25")
def test_the_polish_is_kept_only_where_it_is_no_worse(loops, wide, monkeypatch):
    """Where it is worse the model stays where it was, with the errors that poles have there."""
    real = candidates.fit_joint

    def spoiled(*args, free_linear=False, evaluations=None, **words):
        fit = real(*args, free_linear=free_linear, evaluations=evaluations, **words)
        if not free_linear or evaluations == 1:
            return fit
        return replace(fit, mirror=replace(fit.mirror, E=1.5 * fit.mirror.E), samples_used=-1)

    monkeypatch.setattr(candidates, "fit_joint", spoiled)
    result = identify([wide, *loops], models=("prandtl_ishlinskii_joint",))
    fit = result.fit()
    assert fit.begun
    assert fit.samples_used > 0
    held = replace(poles_of(result.linear.system, result.linear.excited_hz, RATE), delay_s=result.linear.delay_s)
    assert_allclose(fit.linear.poles.frequencies_hz, held.poles.frequencies_hz, rtol=1e-12)
    assert fit.delay_s == held.delay_s
    of = {p.name: e for p, e in zip(fit.structure.parameters, fit.fit.standard_errors, strict=True)}
    of_response = result.linear.poles_error_rad_s[0] / (2 * np.pi)
    assert of["pole 1"] >= 0.99 * of_response / np.sqrt(2)  # as the response knows it, and no better
    assert of["pole 1"] < 0.01 * held.poles.frequencies_hz[0]
    assert of["pole 1 damping"] >= 0.99 * of_response / np.sqrt(2) / held.poles.frequencies_hz[0]
    assert '"linear.poles.1"' in mirror_file_text(result, "m").partition("[uncertainty]")[2]
    static = fit_bouc_wen(loops, starts=1)
    assert refit(None, static, (), None) == (static, ())  # nothing to be freed


@pytest.mark.promise("identify-10", "identify-11")
def test_more_than_one_model_is_polished_before_the_choice(found, loops, wide, monkeypatch):
    """The second on held parts is the better one once everything is free."""
    turned = []

    def sharper(candidates, fit, predictions, on_progress):
        turned.append(fit.name)
        share = 0.01 if fit.name == "linear" else 1.0
        better = [replace(p, model_rad=p.measured_rad - share * p.residual_rad) for p in predictions]
        return replace(fit), tuple(better)

    monkeypatch.setattr(choice, "refit", sharper)
    monkeypatch.setattr(candidates, "_REACH", 100.0)
    models = ("linear", "prandtl_ishlinskii_joint")
    result = identify([wide, *loops], models=models)
    assert turned == ["prandtl_ishlinskii_joint", "linear"]
    assert result.chosen == "linear"  # polished as it is here, it leaves least
    turned.clear()
    monkeypatch.setattr(candidates, "_REACH", 1.0)
    identify([wide, *loops], models=models)
    assert turned == ["prandtl_ishlinskii_joint"]

    def duller(candidates, fit, predictions, on_progress):
        turned.append(fit.name)
        worse = [replace(p, model_rad=p.measured_rad - 100.0 * p.residual_rad) for p in predictions]
        return replace(fit), tuple(worse if fit.name == "prandtl_ishlinskii_joint" else predictions)

    turned.clear()
    monkeypatch.setattr(choice, "refit", duller)
    assert identify([wide, *loops], models=models).chosen == "linear"
    assert turned == ["prandtl_ishlinskii_joint", "linear"]  # that wins now, and was not among the first


@pytest.mark.promise("identify-10")
def test_the_two_best_with_a_linear_part_are_polished_if_they_leave_at_most_twice_as_much(found):
    joint = found.fit("prandtl_ishlinskii_joint")

    def order(*sizes):
        residual = philox(1).standard_normal(100)
        left = [(SimpleNamespace(residual_rad=size * residual, split=0),) for size in sizes]
        return candidates.within_reach([joint] * len(sizes), left)

    assert order(1.9, 1.0, 1.5) == [1, 2]
    assert order(2.1, 1.0) == [1]
    assert order(1.9, 1.0) == [1, 0]
    static = [found.fit("prandtl_ishlinskii"), joint]
    left = [(SimpleNamespace(residual_rad=np.ones(9) * size, split=0),) for size in (1.0, 1.5)]
    assert candidates.within_reach(static, left) == [1]


@pytest.mark.promise("identify-11")
@pytest.mark.parametrize("extra", [0.0, 1e-3, 0.5])
def test_a_tie_goes_to_fewer_parameters(found, extra):
    few, many = found.fit("linear"), found.fit("prandtl_ishlinskii_joint")
    assert len(few.structure.parameters) < len(many.structure.parameters)
    noise, other = philox(1).standard_normal((2, 1000))
    assert choose_best([many, few], [[noise], [noise + extra * other]]) == (0 if extra == 0.5 else 1)
    assert choose_best([few, many], [[noise + extra * other], [noise]]) == (1 if extra == 0.5 else 0)


# ----------------------------------------------------------------------------------------------------- what no fit sees
@pytest.mark.promise("choose-2")
@pytest.mark.promise("identify-8", "identify-9")
@pytest.mark.promise("readme-9")
@pytest.mark.usefixtures("unpolished")
def test_the_held_out_part_is_seen_by_no_fit(loops, wide, found):
    changed = []
    for r in loops:
        drive, output = r.drive.copy(), r.output.copy()
        drive[3000:] = 5.0 + 1.1 * (drive[3000:] - 5.0)
        output[3000:] = 1.7 * output[3000:][::-1]
        changed.append(replace(r, drive=drive, output=output))
    other = identify([wide, *changed], models=FEW, hold_out=0.5)
    same = 0
    for a, b in zip(found.fits, other.fits, strict=True):
        if isinstance(a, JointFit) and len(a.fit.values) != len(b.fit.values):
            continue  # the winner of one of the two, polished
        same += 1
        for x, y in zip(numbers(a), numbers(b), strict=True):
            assert_array_equal(x, y)
    assert same >= 2
    line, unmoved = other.straight_line, found.straight_line
    assert line.fit_rms_percent == unmoved.fit_rms_percent
    assert line.held_out_rms_percent > 5 * unmoved.held_out_rms_percent


@pytest.mark.promise("identify-8", "identify-9")
@pytest.mark.usefixtures("unpolished")
@pytest.mark.promise("identify-54")
def test_validation_is_seen_by_no_fit(loops, wide):
    unseen = loop(5.0, seed=7, amplitude=0.8)
    turned = replace(unseen, output=-unseen.output)
    results = [identify([wide, *loops], models=FEW, validation=[one]) for one in (unseen, turned)]
    for a, b in zip(results[0].fits[:2], results[1].fits[:2], strict=True):
        for x, y in zip(numbers(a), numbers(b), strict=True):
            assert_array_equal(x, y)
    assert [(s.role, s.fitted, s.held_out) for s in results[0].sources] == [
        ("loops", 6000, 0),
        ("loops", 6000, 0),
        ("broadband", 8000, 0),
        ("validation", 0, 6000),
    ]
    good, bad = (r.score("prandtl_ishlinskii_joint") for r in results)
    assert good.held_out_rms_percent < 0.15
    assert bad.held_out_rms_percent > 20
    assert good.fit_rms_percent == pytest.approx(bad.fit_rms_percent, rel=0.5)
    assert results[0].predictions[0][2].split == results[0].predictions[0][2].start


@pytest.mark.promise("identify-8")
def test_a_share_can_be_held_out_beside_validation(loops):
    result = identify(loops, models=("prandtl_ishlinskii",), validation=[loop(5.0)], hold_out=0.25)
    assert [(s.fitted, s.held_out) for s in result.sources] == [(4500, 1500), (4500, 1500), (0, 6000)]
    with pytest.raises(IdentificationError, match=r"hold_out\) is 0.*or 0 with recordings for validation"):
        identify(loops, models=("prandtl_ishlinskii",), hold_out=0.0)


@pytest.mark.promise("identify-3")
@pytest.mark.usefixtures("unpolished")
def test_a_broadband_record_that_is_a_loop_keeps_its_held_out_part(wide):
    """Where all records are broadband they are split, and the linear part is fitted to the same first part."""
    drive = small_multisine(RATE, 1000, 2, rms=1.0)
    record = recorded(drive, truth(drive), RATE, name="large", period=1000)
    output = record.output.copy()
    output[1000:] *= 1.5
    results = [identify([r], models=("linear",), hold_out=0.5) for r in (record, replace(record, output=output))]
    for a, b in zip(*(r.fits for r in results), strict=True):
        if len(a.fit.values) == len(b.fit.values):
            assert_array_equal(a.fit.values, b.fit.values)
    assert_array_equal(results[0].linear.system.A, results[1].linear.system.A)
    assert [(s.role, s.fitted) for s in results[0].sources] == [("loops", 1000)]
    assert results[1].score().held_out_rms_percent > 1.5 * results[0].score().held_out_rms_percent


# -------------------------------------------------------------------------------------------------------------- refusal
@pytest.mark.promise("identify-19")
@pytest.mark.promise("identify-54")
def test_a_model_without_its_linear_part_is_refused(loops):
    result = identify(loops, models=FEW)
    assert [s.model for s in result.scores] == ["prandtl_ishlinskii"]
    assert [r.model for r in result.refused] == ["linear", "prandtl_ishlinskii_joint"]
    assert all("no recording is broadband" in r.reason for r in result.refused)
    with pytest.raises(IdentificationError, match=r"do not support linear: no recording is broadband.*small chirp"):
        identify(loops, models=("linear",))


@pytest.mark.promise("identify-19", "identify-21")
@pytest.mark.promise("identify-54")
def test_creep_on_a_short_record_is_refused():
    drive = truths.two_sines(1000, 50_000.0, 200.0)
    record = recorded(drive, plays(drive, THRESHOLDS, WEIGHTS), 50_000.0)
    result = identify([record], models=("prandtl_ishlinskii", "prandtl_ishlinskii_creep"))
    (refused,) = result.refused
    assert refused.model == "prandtl_ishlinskii_creep"
    assert "lasts 0.01 s" in refused.reason  # half of it is held out
    assert "staircase of 10 s" in refused.reason
    with pytest.raises(IdentificationError, match=r"_creep' was fitted: .* 10 s[^;]*; there are prandtl"):
        mirror_file_text(result, "Mirror", model="prandtl_ishlinskii_creep")
    with pytest.raises(IdentificationError, match=r"do not support prandtl_ishlinskii_creep: .* lasts 0\.01 s"):
        identify([record], models=("prandtl_ishlinskii_creep",))


@pytest.mark.promise("identify-21")
def test_a_joint_fit_that_fails_is_refused_with_its_reason(loops, monkeypatch):
    def failing(*_, **__):
        raise IdentificationError("the mirror cannot be simulated at a step of 0.00025 s")

    monkeypatch.setattr(candidates, "fit_joint", failing)
    result = identify(loops, models=("prandtl_ishlinskii", "prandtl_ishlinskii_rate"))
    assert [(r.model, r.reason) for r in result.refused] == [
        ("prandtl_ishlinskii_rate", "the mirror cannot be simulated at a step of 0.00025 s")
    ]
    with pytest.raises(IdentificationError, match=r"at a step of 0\.00025 s"):
        identify(loops, models=("prandtl_ishlinskii_rate",))


@pytest.mark.promise("identify-21")
def test_an_output_that_does_not_follow_the_drive_is_refused():
    drive = truths.two_sines(4000)
    output = 1e-3 * philox(3).standard_normal(4000)

    def mixed(share):
        return recorded(drive, share * 1e-3 * (drive - 5.0) / drive.std() + output)

    with pytest.raises(IdentificationError) as error:
        identify([mixed(0.8)], models=("prandtl_ishlinskii",))
    left, spread, percent = re.search(
        r"prandtl_ishlinskii, leaves (\S+) rad rms of (\S+) rad .* \((\d+) %, at most 50 % is a model\)",
        str(error.value),
    ).groups()
    assert float(left) == pytest.approx(1e-3, rel=0.05)
    assert float(percent) == pytest.approx(100 * float(left) / float(spread), abs=1)
    assert "check that the channels belong together" in str(error.value)
    assert identify([mixed(2.5)], models=("prandtl_ishlinskii",)).score().fit_rms_percent > 5


# ------------------------------------------------------------------------------------------------------------- warnings
def test_a_model_of_the_truth_leaves_noise_and_a_wrong_one_does_not(found, loops):
    text = "\n".join(found.warnings)
    assert found.residual.samples == 3000
    assert found.residual.white
    assert found.residual.independent
    assert "not white" not in text
    assert "follows the drive" not in text
    assert "Valid for drives from 0.3" in text

    wrong = identify(loops, models=("prandtl_ishlinskii",))
    text = "\n".join(wrong.warnings)
    assert not wrong.residual.white
    assert "The residual on the held-out samples is not white" in text
    assert "the model does not depend on rate: one average loop" in text
    assert "the model does not depend on rate" not in "\n".join(found.warnings)


@pytest.mark.promise("gallery-7")
@pytest.mark.usefixtures("unpolished")
def test_a_pole_outside_the_excited_band_is_told(loops):
    drive = small_multisine(RATE, 4000, 2, highest=0.02)
    narrow = recorded(drive, truth(drive), RATE, noise=1e-4, name="narrow", period=4000)
    result = identify([narrow, *loops], models=("prandtl_ishlinskii_joint",))
    assert result.linear.warnings
    for text in result.linear.warnings:
        assert f"Linear part (in rad/V): {text}" in result.warnings
    assert any("outside" in text for text in result.linear.warnings)


def test_progress_counts_fits_and_ends(found, told):
    assert all(0 <= done <= total for done, total, _ in told)
    fits = [call for call in told if call[2] in (*FEW, "play operators")]
    assert fits == [(1, 3, "play operators"), (2, 3, "linear"), (3, 3, "prandtl_ishlinskii_joint")]
    assert told[0][2].startswith("order")
    assert told[-1][2] == "linear part, hysteresis and creep together"


@pytest.mark.usefixtures("unpolished")
def test_models_fitted_side_by_side_are_those_fitted_in_turn(loops, wide, monkeypatch):
    monkeypatch.setattr(candidates, "_STARTS", 3)
    models, told, heard = (*FEW, "bouc_wen_joint"), [], []
    one, other = (
        identify(
            [wide, loops[1]],
            models=models,
            side_by_side=both,
            on_progress=lambda *args, both=both: told.append(args) if both else None,
            on_fit=lambda judged: heard.append(judged.model),
        )
        for both in (False, True)
    )
    for model in models:  # to the last digit
        assert mirror_file_text(one, "lab", model=model) == mirror_file_text(other, "lab", model=model)
    assert heard[: len(heard) // 2] == heard[len(heard) // 2 :]
    begun = [call[2].startswith("fitting ") for call in told].index(True)
    beside = [call[:2] for call in told[begun:]]
    beside = beside[: beside.index((len(models), len(models)))]
    assert beside == sorted(beside)
    assert {total for _, total in beside} == {len(models)}
    fits = pickle.loads(
        pickle.dumps(one.fits)
    )  # what another process makes of them; one that cannot be is fitted twice
    for name, fit in zip(models, fits, strict=True):
        assert mirror_file_text(replace(one, fits=fits), "lab", model=name) == mirror_file_text(one, "lab", model=name)
        assert not isinstance(fit, JointFit) or (fit.structure.build(fit.fit.values).A == fit.mirror.A).all()


def test_error_of_a_model_fitted_side_by_side(loops, monkeypatch):
    monkeypatch.setattr(candidates, "_STARTS", 1)

    def fails(*args, **options):
        raise IdentificationError("no plays")

    monkeypatch.setattr("microrad.lab.identify.selection.candidates.fit_prandtl_ishlinskii", fails)
    with pytest.raises(IdentificationError, match="no plays"):
        identify(loops, models=STATIC[:2], side_by_side=True)


@pytest.mark.promise("choose-2")
@pytest.mark.promise("identify-1", "identify-19")
@pytest.mark.promise("readme-9")
def test_the_list_of_models_is_whole():
    assert (*STATIC, *FORMS) == MODELS
    assert len(MODELS) == 12
    table = (ROOT / "docs" / "identify.md").read_text(encoding="utf-8").partition("| name | hysteresis | refused |")[2]
    assert set(re.findall(r"^\| `(\w+)` \|", table.partition("\n\n")[0], re.MULTILINE)) == set(MODELS)


# ---------------------------------------------------------------------------------------------------------- mirror file
def simulated(path, drive, step_s):
    """The mirror that a mission makes of a mirror file, from rest at its bias."""
    table = load_mirror(path).mirror
    model = mirror.hysteresis_model(table, table.rate_limit_v_s, table.bias_v)
    plant = mirror.discretise(mirror.from_mission(table, model), step_s)
    output = np.empty((drive.size, 1))
    kernels.open_loop(plant, mirror.at_rest(plant), (drive - table.bias_v)[:, None], output, np.empty((drive.size, 0)))
    return output[:, 0]


def as_chosen(result, fit):
    """An identification whose only fit is this one."""
    score = replace(result.score(), model=fit.name)
    return replace(
        result,
        fits=(fit,),
        scores=(score,),
        chosen=fit.name,
        drive_min_v=0.0,
        drive_max_v=10.0,
        rate_limit_v_per_s=fit.rate_limit_v_per_s,
    )


def centred_loop(freq_hz, rate_hz=1000.0, samples=2000):
    """A drive from 0 V to 10 V that begins in its middle, 5 V."""
    return 5.0 + 5.0 * np.sin(2 * np.pi * freq_hz * np.arange(samples) / rate_hz)


EQ3 = (8e-5, 1e-5, -3e-5, 4e-3, 1.5, 0.4)
WITH_ZERO = LinearPoles(Roots((40.0, 150.0), (1.0, 0.35)), Roots((60.0,), (1.0,)), 3.0)
SHAPES = {
    "bouc_wen_asymmetric": {"gamma": 0.25, "eta": -0.15},
    "bouc_wen_creep": {},
    "prandtl_ishlinskii_rate_creep": None,
    "prandtl_ishlinskii_joint": None,
}


@pytest.mark.parametrize(
    ("name", "sign"),
    [
        ("bouc_wen_asymmetric", 1),
        pytest.param("bouc_wen_creep", 1, marks=pytest.mark.endurance),
        pytest.param("prandtl_ishlinskii_rate_creep", 1, marks=pytest.mark.endurance),
        ("prandtl_ishlinskii_joint", 1),
        ("bouc_wen_asymmetric", -1),
        ("prandtl_ishlinskii_joint", -1),
        *(pytest.param(name, -1, marks=pytest.mark.endurance) for name in SHAPES if "creep" in name),
    ],
)
def test_a_mirror_file_of_a_joint_fit_is_the_same_mirror(found, name, sign, tmp_path):
    drives = [centred_loop(f) for f in (2.5, 10.0)]
    if name.startswith("bouc_wen"):
        outputs = [bouc_wen(d, 1000.0, EQ3, **SHAPES[name]) for d in drives]
    else:
        outputs = [plays(d, THRESHOLDS, WEIGHTS, widening=1e-3) for d in drives]
    if "creep" in name:
        outputs = [y + truths.creep(d, 1000.0, (0.01, 0.1, 1.0), 8e-7) for d, y in zip(drives, outputs, strict=True)]
    linear = WITH_ZERO if name.endswith("joint") else None
    records = [recorded(d, sign * y, seed=k) for k, (d, y) in enumerate(zip(drives, outputs, strict=True))]
    fit = fit_joint(records, name, Units(), linear=linear, starts=1, hold="first-order")  # as simulations take a drive
    text = mirror_file_text(as_chosen(found, fit), "m")
    path = tmp_path / "mirror.toml"
    path.write_text(text, encoding="utf-8")

    drive = centred_loop(7.0)
    expected, _ = fit.response(drive, 1e-3)
    got = simulated(path, drive, 1e-3)
    assert np.ptp(got) > 5e-4
    assert_allclose(sign * got, expected, atol=1e-9 * np.ptp(expected))
    assert ("sign was flipped" in text) == (sign < 0)

    table = load_mirror(path).mirror
    assert (table.creep is not None) == ("creep" in name)
    assert (table.linear is not None) == (linear is not None)
    assert table.composition == ("static" if linear is None else "cascade")
    if table.creep is not None:
        assert table.creep.time_constants_s == fit.creep.time_constants_s
    if linear is not None:
        assert table.linear.poles_hz == pytest.approx(WITH_ZERO.poles.frequencies_hz)
        assert table.linear.pole_dampings == pytest.approx(WITH_ZERO.poles.dampings)
        assert table.linear.zeros_hz == (60.0,)
        assert table.linear.normalise_at_hz == 3.0
        assert table.linear.excited_from_hz == pytest.approx(found.linear.excited_hz[0])
        assert "held in the joint fit, from wide" in text
    if name == "prandtl_ishlinskii_rate_creep":
        assert table.prandtl_ishlinskii.widening_s == fit.model.widening_s > 5e-4
    if name == "bouc_wen_asymmetric":
        assert abs(table.bouc_wen.gamma_1_v) == pytest.approx(0.25, rel=0.1)
        assert table.bouc_wen.eta_1_v == pytest.approx(-0.15, rel=0.1)


def test_a_widening_of_nothing_is_written_without_an_error(found, tmp_path):
    """Its derivative was taken to both sides of its bound, and thresholds cannot narrow."""
    drives = [centred_loop(f) for f in (2.5, 10.0)]
    records = [recorded(d, plays(d, THRESHOLDS, WEIGHTS), seed=k) for k, d in enumerate(drives)]
    fit = fit_joint(records, "prandtl_ishlinskii_rate", Units(), starts=1)
    fit = replace(fit, fit=replace(fit.fit, values=np.append(fit.fit.values[:-1], 0.0)))
    path = tmp_path / "mirror.toml"
    path.write_text(mirror_file_text(as_chosen(found, fit), "m"), encoding="utf-8")
    known = load_mirror(path).mirror.uncertainty.parameters
    assert "prandtl_ishlinskii.weights.1" in known and "prandtl_ishlinskii.widening" not in known


@pytest.mark.promise("identify-24")
@pytest.mark.promise("readme-9")
def test_standard_errors_in_the_file_are_propagated_ones(found, tmp_path):
    drives = [centred_loop(f) for f in (2.5, 10.0)]
    records = [recorded(d, bouc_wen(d, 1000.0, EQ3, gamma=0.25, eta=-0.15), seed=k) for k, d in enumerate(drives)]
    fit = fit_joint(records, "bouc_wen_asymmetric", Units(), starts=1)
    text = mirror_file_text(as_chosen(found, fit), "m")
    names = [p.name for p in fit.structure.parameters]
    covariance = fit.fit.covariance
    at = dict(zip(names, fit.fit.values, strict=True))
    a, b = names.index("alpha"), names.index("beta over alpha")
    gradient = np.zeros(len(names))
    gradient[a], gradient[b] = at["beta over alpha"], at["alpha"]
    beta = float(np.sqrt(gradient @ covariance @ gradient))
    for key, error, unit in (
        ("beta", beta, "1/V"),
        ("alpha", float(np.sqrt(covariance[a, a])), "1/V"),
        ("d1", 1e3 * float(fit.fit.standard_errors[names.index("d1")]), "mrad/V"),
        ("delta", float(fit.fit.standard_errors[names.index("delta")]), "s/V"),
    ):
        line = next(line for line in text.splitlines() if line.startswith(f"{key} = "))
        printed = re.search(r"± standard error (\S+) (\S+), from", line)
        assert float(printed[1]) == pytest.approx(error, rel=0.06), key  # two digits
        assert printed[2] == unit
    (again,) = propagated(lambda v: np.array([v[a] * v[b]]), fit.fit.values, covariance)
    assert again == pytest.approx(beta, rel=1e-5)


def test_an_exponent_comes_through_the_file(found, tmp_path):
    drive = centred_loop(2.5, 400.0, 1000)
    classical = (EQ3[0], 0.0, EQ3[2], 0.0, *EQ3[4:])
    fit = fit_joint(
        [recorded(drive, bouc_wen(drive, 400.0, classical, exponent=2.0), 400.0)],
        "bouc_wen_classical",
        Units(),
        starts=1,
    )
    text = mirror_file_text(as_chosen(found, fit), "m")
    path = tmp_path / "mirror.toml"
    path.write_text(text, encoding="utf-8")
    assert load_mirror(path).mirror.bouc_wen.exponent == fit.model.exponent > 1.5
    expected, _ = fit.response(drive, 1 / 400.0)
    assert_allclose(simulated(path, drive, 1 / 400.0), expected, atol=1e-9 * np.ptp(expected))
    assert "held, not fitted" in text  # d2 and delta are 0 in the classical model


@pytest.mark.promise("identify-62", "identify-63")
def test_what_records_do_not_show_is_in_no_error_and_in_no_residual():
    """A mirror that stops beyond the recorded drives, none of the models, gives the records of one of plays."""
    found, left = [], []
    for stop_v in (np.inf, 10.0):

        def of_mirror(drive, stop_v=stop_v):
            return plays(np.minimum(drive, stop_v), THRESHOLDS, WEIGHTS)

        drives = [truths.two_sines(3000, freq_hz=freq_hz) for freq_hz in (2.0, 3.0)]
        known, unseen = (recorded(each, of_mirror(each), name=f"{k}", seed=k) for k, each in enumerate(drives))
        found.append(identify([known], models=("prandtl_ishlinskii",), validation=[unseen]))
        other = 5.0 + 2.0 * (drives[0] - 5.0)
        modelled, measured = found[-1].fit().response(other, 1e-3)[0], of_mirror(other)
        left.append(100 * np.std(modelled - measured) / np.ptp(measured))
    right, wrong = found
    assert_array_equal(wrong.fit().standard_errors_rad_per_v, right.fit().standard_errors_rad_per_v)
    assert wrong.score().held_out_rms_percent == right.score().held_out_rms_percent < 0.2
    assert left[0] < 0.1 and left[1] > 5.0


# ---------------------------------------------------------------------------------------------------- the virtual bench
@pytest.mark.endurance
@pytest.mark.usefixtures("unpolished")
def test_the_papers_chirp_on_the_virtual_bench():
    """Noise of 3 % rms leaves a fit of 97 % at best; the drive rests at 6 V, which is no part of the response."""
    result = identify(bench.play(bench.load_plan("paper-experiment"), seed=1), models=("linear",))
    assert 96.9 <= result.linear.fit_percent[0] < 97.1
    poles_hz = np.abs(result.linear.poles_rad_s) / (2 * np.pi)
    assert_allclose(sorted(poles_hz[poles_hz > 2.0]), [54.22, 1552.7, 2542.7, 2542.7], rtol=0.05)  # the rest is drift


def test_eq_3_fitted_at_100_hz_predicts_60_and_80_hz():
    others = "loop-60hz", "loop-80hz"
    plan = bench.select_records(bench.load_plan("paper-experiment"), [*others, "loop-100hz"])
    by_name = {r.path: r for r in bench.play(plan, seed=1)}
    fit = fit_bouc_wen([by_name["loop-100hz"]], starts=2)
    for name in others:
        prediction = predict(fit, by_name[name])
        residual = prediction.residual_rad[prediction.start :]
        assert 0 < np.sqrt(np.mean(residual**2)) < 0.01 * np.ptp(prediction.measured_rad)
        (record,) = (r for r in plan.records if r.excitation.name == name)
        exact = 1e-3 * true_output(plan, record)[1][:, 0]
        beyond = (exact - prediction.model_rad)[prediction.start :]
        assert np.std(beyond) < 1e-4 * np.ptp(exact)  # what is left is the sensor's noise


@pytest.mark.promise("choose-4")
@pytest.mark.promise("bench-1")
@pytest.mark.endurance
@pytest.mark.usefixtures("unpolished")
def test_the_benchs_own_mirror_is_predicted_with_half_the_error_of_the_papers_model(monkeypatch):
    """A reduced plan; the truth is none of the models. Held out are a frequency and amplitude, and a multisine."""
    monkeypatch.setattr(candidates, "_STARTS", 4)
    plan = bench.load_plan("mirror-characterisation")
    names = ["small-multisine-1", "loops-40hz", "loops-100hz", "held-out-sine", "held-out-multisine"]
    pairs = list(play_records(bench.select_records(plan, names), seed=1))
    known = [recording for record, recording in pairs if record.use == "identification"]
    unseen = [recording for record, recording in pairs if record.use == "validation"]
    assert (len(known), len(unseen)) == (3, 2)
    models = ("bouc_wen", "prandtl_ishlinskii_joint")
    result = identify(known, models=models, validation=unseen)
    assert result.chosen == "prandtl_ishlinskii_joint"
    assert result.score().held_out_rms_percent <= 0.5 * result.score("bouc_wen").held_out_rms_percent
    assert result.score().held_out_rms_percent < 1.0
    assert isinstance(result.fit().model, PrandtlIshlinskii)


@pytest.mark.promise("identify-64")
@pytest.mark.usefixtures("unpolished")
def test_the_example_of_the_page_writes_the_mirror_of_a_mission(monkeypatch, capsys, tmp_path):
    """With two models and three records of its plan: all of them take minutes."""
    names = ["small-multisine-1", "loops-40hz", "held-out-sine"]
    load = bench.load_plan
    monkeypatch.setattr(bench, "load_plan", lambda name: bench.select_records(load(name), names))
    monkeypatch.setattr(identification, "MODELS", ("linear", "prandtl_ishlinskii"))
    code = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[0]
    known = {}
    exec(code, known)
    found = known["found"]
    assert [score.model for score in found.scores] == list(identification.MODELS)
    assert [each.path for each in known["unseen"]] == names[2:]
    assert capsys.readouterr().out == "\n".join([found.chosen, found.reason, *found.warnings, ""])
    (tmp_path / "mirror.toml").write_text(known["text"], encoding="utf-8")
    assert load_mirror(tmp_path / "mirror.toml").mirror.name == "our mirror"


@pytest.mark.promise("identify-30")
@pytest.mark.endurance
def test_the_table_of_the_page_is_what_the_benchs_plan_gives():
    """To half of the last digit that is printed, and a hundredth for where a search ends."""
    plan = bench.load_plan("mirror-characterisation")
    pairs = list(play_records(plan, seed=1))
    known, unseen = ([r for record, r in pairs if record.use == use] for use in ("identification", "validation"))
    result = identify(known, models=MODELS, validation=unseen)
    page = PAGE.partition("| model | fitted | held out |")[2]
    rows = re.findall(r"^\| `(\w+)`(.*) \| ([\d.]+) \| ([\d.]+) \|$", page.partition("\n\n")[0], re.MULTILINE)
    assert [name for name, chosen, _, _ in rows if "chosen" in chosen] == [result.chosen]
    assert len(rows) == 11
    for name, _, fitted, held_out in rows:
        score = result.score(name)
        assert score.fit_rms_percent == pytest.approx(float(fitted), rel=0.01, abs=5e-4)
        assert score.held_out_rms_percent == pytest.approx(float(held_out), rel=0.01, abs=5e-4)


@pytest.mark.parametrize(
    ("held_out", "spread", "residual", "told"),
    [
        (9.0, 2.0, 2.0, False),
        (9.01, 2.0, 1.0, False),
        (9.01, 2.0, 1.01, True),
        (20.0, 2.0, 2.0, True),
    ],
)
def test_a_model_is_unsupported_where_a_line_does_as_well_and_half_of_the_output_is_left(
    held_out, spread, residual, told
):
    """Nine tenths of the line's error and half of the output are enough; what was fitted does not count."""
    turns = np.where(np.arange(100) % 2, 1.0, -1.0)
    measured = np.concatenate([np.full(100, 50.0), 7.0 + spread * turns])
    seen = predictions.Prediction(measured - np.concatenate([np.full(100, 9.0), residual * turns]), measured, 0, 100, 0)
    score, line = (predictions.Score(name, 1.0, 1.0, rms, 1.0) for name, rms in (("m", held_out), ("line", 10.0)))
    text = choice._unsupported(score, line, [seen])
    assert bool(text) == told
    if told:
        assert text.startswith(
            f"the recordings do not support a model: the chosen one, m, leaves {residual:.3g} rad rms of 2 rad on "
            f"the held-out samples, where a straight line does as well ({50 * residual:.0f} %, at most 50 % is a "
            "model). It follows the part that was fitted"
        )


def test_the_reason_of_a_choice_names_those_that_only_chance_makes_better():
    def scored(name, rms):
        return predictions.Score(name, 0.5, 1.0, rms, 2.0)

    line, found = (
        scored("straight line", 9.0),
        [scored("a", 1.0), scored("b", 0.96), scored("c", 0.97), scored("d", 2.0)],
    )
    assert choice._reason(found, line, 1) == (
        "b leaves 0.96 % of the peak-to-peak output (rms) on the held-out samples, against 1 % by a, 0.97 % by c, 2 % "
        "by d, 9 % by a straight line."
    )
    assert choice._reason(found, line, 0).endswith(
        "9 % by a straight line. The difference to b and c is below two standard errors; among such models those that "
        "never move the wrong way after a reversal go first, then those with fewer parameters."
    )
    alike = [scored("a", 1.0), scored("b", 1.0)]
    assert "The difference" not in choice._reason(alike, line, 0)


def test_the_mirror_of_an_identification_is_that_of_the_chosen_model(found):
    assert found.mirror is found.fit("prandtl_ishlinskii_joint").mirror
    assert found.mirror.A.size > 0
    static = replace(found, chosen="prandtl_ishlinskii")
    assert static.mirror.A.size == 0
    assert static.mirror.plays == (static.model,) == (found.fit("prandtl_ishlinskii").model,)
    assert static.mirror.name == "prandtl_ishlinskii"
    assert (static.fit(), static.score().model) == (found.fits[0], "prandtl_ishlinskii")


def test_a_model_that_was_not_fitted_is_refused_with_its_own_reason(found):
    known = "there are prandtl_ishlinskii, linear, prandtl_ishlinskii_joint."
    refused = (candidates.Refused("bouc_wen", "of another."), candidates.Refused("bouc_wen_joint", "of its own."))
    other = replace(found, refused=refused)
    for model, why in (("bouc_wen_joint", ": of its own"), ("bouc_wen_creep", "")):
        with pytest.raises(IdentificationError) as caught:
            other.fit(model)
        assert str(caught.value) == f"no model '{model}' was fitted{why}; {known}"


@pytest.mark.parametrize(
    ("poles_hz", "zeros_hz", "kept"),
    [
        ((0.5, 80.0), (0.6,), ((80.0,), ())),
        ((0.5, 0.7, 80.0), (0.6,), ((0.5, 0.7, 80.0), (0.6,))),  # one more pole than zeros: that is no flank
        ((0.5, 80.0), (1.5,), ((0.5, 80.0), (1.5,))),
        ((2.0, 80.0), (1.5,), ((2.0, 80.0), (1.5,))),
        ((5.0, 80.0), (999.0,), ((5.0, 80.0), (999.0,))),
        ((5.0, 80.0), (1001.0,), ((5.0, 80.0), ())),
    ],
)
def test_what_lies_below_the_band_and_above_the_rate_is_left_out_of_the_linear_part(poles_hz, zeros_hz, kept):
    """Excited from 1 Hz to 400 Hz at 1 kHz: the middle of the band is 20 Hz, without a resonance."""
    zeros, poles = (-2 * np.pi * np.array(each, dtype=complex) for each in (zeros_hz, poles_hz))
    found = poles_of(lti.modal_from_roots(zeros, poles, 20.0), (1.0, 400.0), 1000.0)
    for roots, frequencies_hz in zip((found.poles, found.zeros), kept, strict=True):
        assert_allclose(roots.frequencies_hz, frequencies_hz, rtol=1e-6)
        assert roots.dampings == (1.0,) * len(frequencies_hz)
    assert found.normalise_at_hz == pytest.approx(20.0)


def test_the_linear_part_is_normalised_below_a_tenth_of_its_lowest_resonance_and_within_the_band():
    for f, at in ((90.0, 3.0), (5.0, 1.0), (8000.0, 20.0)):
        pair = 2 * np.pi * f * np.array([-0.1 + 0.995j, -0.1 - 0.995j])
        found = poles_of(lti.modal_from_roots(np.array([]), pair, 1.0), (1.0, 400.0), 1000.0)
        assert found.normalise_at_hz == pytest.approx(at, rel=1e-2)
        assert found.poles.dampings == pytest.approx((0.1,), rel=1e-2)


def joint_fit_of(**parts):
    """What of a joint fit is looked at."""
    fit = object.__new__(JointFit)
    for key, value in parts.items():
        object.__setattr__(fit, key, value)
    return fit


@pytest.mark.parametrize(
    ("weights", "admissible"),
    [
        ((6e-5, 1e-5), True),
        ((6e-5, 0.0), True),
        ((6e-5, -1e-5), False),
        ((-6e-5, -1e-5), True),
        ((-6e-5, 1e-5), False),
        ((-6e-5, 0.0), True),
    ],
)
def test_plays_of_one_sign_are_admissible(weights, admissible):
    fit = joint_fit_of(model=PrandtlIshlinskii((0.0, 1.0), weights))
    assert fit.admissible is admissible
    assert fit.falling is (weights[0] < 0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("epsilon", "admissible"), [(-8.0, True), (-8.0078125, True), (-8.0083, False), (8.0, True)])
def test_a_joint_bouc_wen_model_is_admissible_up_to_a_thousandth_of_its_gain(sign, epsilon, admissible):
    """The slope behind a reversal is 16 + 2 epsilon, down to -0.016."""
    fit = joint_fit_of(model=BoucWen(16.0 * sign, 0.0, epsilon * sign, 0.0, 1.0, 0.0))
    assert fit.admissible is admissible
    assert fit.falling is (sign < 0)


@pytest.mark.parametrize(
    ("lengths", "step_s", "supported"),
    [
        ((1000,), 1e-3, True),
        ((999,), 1e-3, False),
        ((100, 1000), 1e-3, True),  # the longest counts
        ((1000,), 0.05, True),  # two decades: 1 s and 10 s
        ((100,), 0.2, False),  # 10 s alone
    ],
)
def test_creep_asks_for_a_second_and_two_decades(lengths, step_s, supported):
    records = [SimpleNamespace(drive_v=np.zeros(samples), step_s=step_s) for samples in lengths]
    models = ["prandtl_ishlinskii", "prandtl_ishlinskii_rate", "prandtl_ishlinskii_creep"]
    names, refused = candidates.supported_models(models, records, has_linear=False)
    assert names == models[: 2 + supported]
    assert [(each.model, "and creep shows over seconds" in each.reason) for each in refused] == [
        (model, True) for model in models[2 + supported :]
    ]


@pytest.mark.parametrize("has_linear", [True, False])
def test_a_cascade_asks_for_a_linear_part(has_linear):
    records = [SimpleNamespace(drive_v=np.zeros(500), step_s=1e-3)]
    models = ["prandtl_ishlinskii_joint", "bouc_wen", "linear"]
    names, refused = candidates.supported_models(models, records, has_linear=has_linear)
    assert names == (models if has_linear else ["bouc_wen"])
    assert [each.model for each in refused] == ([] if has_linear else [models[0], models[2]])


def test_poles_of_a_response_are_known_as_it_knows_them_and_no_better():
    """Of a pair half of the squared error lies along the root; a real root has all of it, and no damping to err in."""
    linear = LinearPoles(Roots((100.0, 40.0), (0.3, 1.0)), Roots((60.0,), (1.0,)), 3.0)
    names = ("weight", "pole 1", "pole 1 damping", "pole 2", "zero 1", "delay")
    parameters = [SimpleNamespace(name=name) for name in names]
    own = np.array([1.0, 1e-3, 1e-6, 50.0, 1e-3, 1e-9])
    between = np.full((6, 6), 0.25) + 0.75 * np.eye(6)
    known = SimpleNamespace(covariance=own[:, None] * between * own, standard_errors=own)
    fit = joint_fit_of(fit=known, linear=linear, structure=SimpleNamespace(parameters=parameters))
    turn = 2 * np.pi
    response = SimpleNamespace(
        delay_error_s=1e-6,
        poles_rad_s=turn * np.array([-41.0, -30 + 95j, -30 - 95j]),
        poles_error_rad_s=turn * np.array([3.0, 2.0, 2.0]),
        zeros_rad_s=turn * np.array([-61.0 + 0j]),
        zeros_error_rad_s=turn * np.array([0.5]),
    )
    found = candidates._held_covariance(fit, response)
    half = 2.0 / np.sqrt(2.0)
    assert_allclose(np.sqrt(np.diag(found)), [1.0, half, half / 100.0, 50.0, 0.5, 1e-6], rtol=1e-12)
    size = np.sqrt(np.diag(found))
    assert_allclose(found / np.outer(size, size), between, rtol=1e-12)
    empty = SimpleNamespace(**{**vars(response), "zeros_rad_s": np.empty(0), "zeros_error_rad_s": np.empty(0)})
    assert np.sqrt(candidates._held_covariance(fit, empty)[4, 4]) == pytest.approx(1e-3)
    assert candidates._held_covariance(fit, None) is known.covariance


def test_what_a_choice_rests_on_has_its_errors_in_microradians():
    found = predictions.Evidence((("slow.csv", 2.0),), "fast.csv", 3e-6, 9e-6)
    assert choice._rests_on(found).endswith("is fast.csv, with 3 µrad rms and 9 µrad at most.")


@pytest.mark.promise("identify-11")
def test_a_tie_goes_to_the_admissible_model_however_many_parameters_it_has():
    wrong_way, plays = (SimpleNamespace(admissible=good, parameter_count=n) for good, n in ((False, 6), (True, 10)))
    noise = philox(2).standard_normal(1000)
    assert choose_best([wrong_way, plays], [[noise], [noise]]) == 1
    assert choose_best([plays, wrong_way], [[noise], [noise]]) == 0


def test_what_does_not_vary_is_correlated_with_nothing():
    assert_array_equal(correlation(np.diag([4.0, 0.0])), np.diag([1.0, 0.0]))
    assert_allclose(correlation(np.array([[4e-24, -1e-18], [-1e-18, 1e-12]])), [[1.0, -0.5], [-0.5, 1.0]])


# ------------------------------------------------------------------------------------------ the candidates, by hand
def of(samples, name="r", *, drive=None, rate_hz=50.0, sha256=None, role=""):
    """A record of noise, every number its own."""
    draw = philox(samples)
    drive = draw.standard_normal(samples) + 4.0 if drive is None else np.asarray(drive, dtype=float)
    output = draw.standard_normal(drive.size)
    digest = name if sha256 is None else sha256
    return Recording(name, digest, drive[:, None], output[:, None], rate_hz, ("u",), ("y",), role=role)


def candidates_of(**given):
    """Two loops, each with its own split, a record for validation and a broadband one."""
    loops = [of(400, "a"), of(300, "b")]
    made = {
        "loops": loops,
        "splits": [250, 170],
        "heads": [loops[0].first(250), loops[1].first(170)],
        "validation": (of(220, "v"),),
        "broadband": [of(500, "w")],
        "linear": None,
        "units": Units("mV", "um", 0.5),
        "span_rad": 2.0,
        "seed": 7,
        "admissible": True,
        "hold": "first-order",
    }
    return candidates.Candidates(**made | given)


def test_all_is_judged_by_loops_from_their_splits_on_and_by_validation_from_its_begin(monkeypatch):
    one = candidates_of()
    assert [r.path for r in one.recordings] == ["a", "b", "v"] and one.all_splits == [250, 170, 0]
    monkeypatch.setattr(candidates, "predict", lambda *given: (given[0], given[1].path, given[2]))
    assert one.predict("fit") == (("fit", "a", 250), ("fit", "b", 170), ("fit", "v", 0))


def test_a_score_is_of_all_samples_together_in_per_cent_of_the_span():
    """Fitted: 3 and 4 of the first loop, 5 of the second one. Unseen: 6, 7, and 8 and 9 of validation."""
    left = [([99.0, 3.0, -4.0, 6.0], 1, 3), ([99.0, 99.0, 5.0, -7.0], 2, 3), ([99.0, 99.0, 8.0, 9.0], 2, 2)]
    seen = [predictions.Prediction(np.zeros(4), np.array(values), *at, 0) for values, *at in left]
    score = candidates_of().score("m", seen)
    assert score.model == "m"
    assert (score.fit_rms_percent, score.fit_peak_percent) == pytest.approx((50 * np.sqrt(50 / 3), 250.0))
    assert (score.held_out_rms_percent, score.held_out_peak_percent) == pytest.approx((50 * np.sqrt(230 / 4), 450.0))
    scored = candidates_of().scored(SimpleNamespace(name="m"), tuple(seen))
    assert (scored.model, scored.score, scored.predictions) == ("m", score, tuple(seen))
    assert [r.path for r in scored.recordings] == ["a", "b", "v"]


def test_each_kind_of_model_is_fitted_with_what_belongs_to_it(monkeypatch):
    given = {}

    def kept(name):
        return lambda *args, **words: given.update({name: (args, words)}) or f"the {name}"

    for name in ("fit_prandtl_ishlinskii", "fit_bouc_wen", "fit_joint"):
        monkeypatch.setattr(candidates, name, kept(name))
    one, told = candidates_of(), []

    def progress(*args):
        told.append(args)

    assert one._fit("prandtl_ishlinskii", "poles", progress) == "the fit_prandtl_ishlinskii"
    assert given.pop("fit_prandtl_ishlinskii") == ((one.heads,), {"units": one.units})
    assert told == [(1, 1, "play operators")]
    assert one._fit("bouc_wen_admissible", "poles", progress) == "the fit_bouc_wen"
    words = {"starts": 12, "seed": 7, "admissible": True, "on_progress": progress, "units": one.units}
    assert given.pop("fit_bouc_wen") == ((one.heads,), words) and "_static_start" not in vars(one)
    assert one._fit("bouc_wen", "poles", progress) == "the fit_bouc_wen" == vars(one)["_static_start"]
    assert given.pop("fit_bouc_wen") == ((one.heads,), words | {"admissible": False})
    assert one._fit("bouc_wen_creep", "poles", progress) == "the fit_joint"
    joint = {"linear": "poles", "admissible": True, "static": "the fit_bouc_wen", "hold": "first-order", "seed": 7}
    assert given.pop("fit_joint") == ((one.heads, "bouc_wen_creep", one.units), joint) and given == {}
    one._fit("prandtl_ishlinskii_rate", None, progress)
    assert given.pop("fit_joint")[1] == joint | {"static": None, "linear": None}
    assert told[1:] == [(0, 1, "fitting bouc_wen_creep"), (0, 1, "fitting prandtl_ishlinskii_rate")]
    begin = SimpleNamespace(name="linear", linear="its poles")
    assert one.freed(begin, progress, evaluations=5) == "the fit_joint"
    free = {"linear": "its poles", "free_linear": True, "admissible": True, "broadband": one.broadband}
    free |= {"hold": "first-order", "begin": begin, "evaluations": 5}
    assert given.pop("fit_joint") == ((one.heads, "linear", one.units), free)
    assert told[-1] == (0, 1, "linear part, hysteresis and creep together")


def test_fits_are_counted_by_their_starts_and_one_that_fails_is_refused(monkeypatch):
    """Twelve starts of Eq. 3, and one of every other model."""

    def fitted(self, model, poles, progress):
        progress(3, 99, f"in {model}")
        if model == "linear":
            raise IdentificationError("it cannot be.")
        return f"fit of {model}, {poles}"

    monkeypatch.setattr(candidates.Candidates, "_fit", fitted)
    told, heard = [], []
    models = ("prandtl_ishlinskii", "bouc_wen_admissible", "linear", "bouc_wen", "bouc_wen_creep")
    fits, failed = candidates_of().fit_all(models, lambda *args: told.append(args), heard.append)
    assert fits == heard == [f"fit of {model}, None" for model in models if model != "linear"]
    assert failed == [candidates.Refused("linear", "it cannot be.")]
    assert told == [
        (3, 27, "in prandtl_ishlinskii"),
        (4, 27, "in bouc_wen_admissible"),
        (16, 27, "in linear"),
        (14, 27, "linear"),
        (17, 27, "in bouc_wen"),
        (29, 27, "in bouc_wen_creep"),
        (27, 27, "bouc_wen_creep"),
    ]
    with pytest.raises(IdentificationError, match=r"^it cannot be\.$"):
        candidates_of().fit_all(["linear"], lambda *_: None, heard.append)

    def refused(self, model, poles, progress):
        raise IdentificationError(f"no {model}.")

    monkeypatch.setattr(candidates.Candidates, "_fit", refused)
    with pytest.raises(IdentificationError, match=r"^no bouc_wen\.$"):
        candidates_of().fit_all(["linear", "bouc_wen"], lambda *_: None, heard.append)


def test_poles_of_the_linear_part_have_its_delay_and_the_error_of_that(monkeypatch):
    found, given = LinearPoles(Roots((80.0,), (0.2,)), Roots((), ()), 3.0), []
    monkeypatch.setattr(candidates, "poles_of", lambda *args: given.append(args) or found)
    monkeypatch.setattr(candidates.Candidates, "_fit", lambda self, model, poles, progress: poles)
    linear = SimpleNamespace(system="system", excited_hz=(2.0, 300.0), rate_hz=4000.0, delay_s=3e-4, delay_error_s=5e-6)
    fits, _ = candidates_of(linear=linear).fit_all(["linear"], lambda *_: None, lambda fit: None)
    assert fits == [replace(found, delay_s=3e-4, delay_error_s=5e-6)]
    assert given == [("system", (2.0, 300.0), 4000.0)]


def test_the_linear_part_is_fitted_in_volts_and_radians_from_where_the_drive_begins(monkeypatch):
    given = []
    monkeypatch.setattr(candidates, "fit_axis", lambda *args, **words: given.append((args, words)) or "fit")
    one = of(6, "w", drive=[5.0, 7.0, 2.0, 5.0, 9.0, 1.0])
    units = Units("mV", "um", 0.5)
    assert candidates.fit_linear_part([one, one], units, ("bouc_wen", "linear"), "first-order", "told") == "fit"
    ((scaled,), words) = given.pop()
    assert words == {"hold": "first-order", "on_progress": "told"} and len(scaled) == 2
    assert_allclose(scaled[1].drive[:, 0], [0.0, 2e-3, -3e-3, 0.0, 4e-3, -4e-3])
    assert_allclose(scaled[1].output, 2e-6 * one.output)
    assert candidates.fit_linear_part([one], units, ("bouc_wen", "prandtl_ishlinskii"), "first-order", None) is None
    assert candidates.fit_linear_part([], units, ("linear",), "first-order", None) is None and given == []


def test_models_that_recordings_cannot_support_are_refused_in_full():
    records = [SimpleNamespace(drive_v=np.zeros(n), step_s=1e-3) for n in (500, 876, 100)]
    names, refused = candidates.supported_models(
        ["linear", "bouc_wen_creep", "bouc_wen_joint", "bouc_wen"], records, has_linear=False
    )
    assert names == ["bouc_wen"]
    wide = "no recording is broadband, so there is no linear part; record a small chirp or multisine as well"
    short = "the longest recording lasts 0.876 s, and creep shows over seconds; record a staircase of 10 s"
    assert [(each.model, each.reason) for each in refused] == [
        ("linear", wide),
        ("bouc_wen_creep", short),
        ("bouc_wen_joint", wide),
    ]
    with pytest.raises(IdentificationError) as caught:
        candidates.supported_models(["bouc_wen_creep", "linear"], records, has_linear=False)
    assert str(caught.value) == f"the recordings do not support bouc_wen_creep: {short}."


def left(*sizes):
    """Predictions of one record each that leave this, all of it unseen but the first of four samples."""
    turns = np.array([9.0, 1.0, -1.0, 1.0])
    return tuple(predictions.Prediction(np.zeros(4), size * turns, 0, 1, 0) for size in sizes)


def test_at_most_two_within_twice_the_least_error_are_polished_the_best_first():
    cascade, static = joint_fit_of(linear="part"), joint_fit_of(linear=None)
    fits = [cascade, static, cascade, cascade, cascade, object()]
    seen = [left(1.99), left(1.0), left(1.5, 0.1), left(2.01), left(1.2), left(1.1)]
    assert candidates.within_reach(fits, seen) == [4, 2]
    assert candidates.within_reach(fits[:4], seen[:4]) == [2, 0]
    assert candidates.within_reach(fits[:2], [left(2.0), left(1.0)]) == [0]
    assert candidates.within_reach(fits[:2], [left(2.001), left(1.0)]) == []


@dataclass
class PlantErrors:
    """What of a fit is kept where it is not moved."""

    covariance: object
    converged: bool
    evaluations: int


def replaced(given, /, **changes):
    return joint_fit_of(**vars(given) | changes)


@pytest.mark.parametrize(("family", "worse"), [("bouc_wen", 1.0), ("bouc_wen", 3.0), ("linear", 1.0), ("linear", 3.0)])
def test_a_model_is_fitted_once_more_and_kept_where_that_is_worse(monkeypatch, family, worse):
    """With fewer poles first where it is a Bouc-Wen model; where it is worse it has the errors of all its numbers."""
    asked = []
    noise = philox(3).standard_normal(400)
    before = (predictions.Prediction(np.zeros(400), noise, 0, 100, 0),)
    after = (predictions.Prediction(np.zeros(400), worse * noise, 0, 100, 0),)

    def freed(begin, progress, evaluations=None):
        asked.append((begin.label, evaluations))
        known = PlantErrors("covariance there", True, 99)
        return replaced(begin, label=f"{begin.label} freed {evaluations}", fit=known)

    fit = joint_fit_of(
        label="fit", linear="part", form=SimpleNamespace(family=family), fit=PlantErrors("own", False, 12)
    )
    of_all = SimpleNamespace(freed=freed, predict=lambda free: after, linear="response")
    monkeypatch.setattr(candidates, "_without_spare_poles", lambda of, begin, progress: replaced(begin, label="fewer"))
    monkeypatch.setattr(candidates, "_held_covariance", lambda there, response: (there.label, response))
    monkeypatch.setattr(
        candidates, "replace", lambda of, **to: (replaced if of.__class__ is JointFit else replace)(of, **to)
    )
    found, seen = candidates.refit(of_all, fit, before, None)
    begun = "fewer" if family == "bouc_wen" else "fit"
    rough = [("fit", 5)] if family == "bouc_wen" else []
    if worse == 1.0:
        assert asked == [*rough, (begun, None)] and seen is after and found.label == f"{begun} freed None"
        return
    assert asked == [*rough, (begun, None), ("fit", 1)] and seen is before
    assert found.label == "fit freed 1"
    assert vars(found.fit) == {"covariance": ("fit freed 1", "response"), "converged": False, "evaluations": 12}
    static = replaced(fit, linear=None)
    assert candidates.refit(of_all, static, before, None) == (static, before)


def test_the_best_is_polished_as_long_as_another_one_becomes_the_best(monkeypatch):
    """Of four two are in reach; then the third one is the best, and is polished, too; then one that was already."""
    turns, heard = [], []

    def polished(of, fit, seen, progress):
        turns.append((fit, seen, progress))
        return (fit, seen) if fit == "b" else (fit.upper(), f"{seen} anew")

    monkeypatch.setattr(choice, "within_reach", lambda fits, seen: [1, 0])
    monkeypatch.setattr(choice, "refit", polished)
    monkeypatch.setattr(choice, "_best", lambda fits, seen: 2 if len(turns) < 3 else 0)
    monkeypatch.setattr(choice, "has_linear", lambda fit: fit != "d")
    fits, seen = ["a", "b", "c", "d"], ["of a", "of b", "of c", "of d"]
    of_all = SimpleNamespace(scored=lambda fit, predicted: (fit, predicted))
    assert choice._polished(of_all, fits, seen, "told", heard.append) == 0
    assert turns == [("b", "of b", "told"), ("a", "of a", "told"), ("c", "of c", "told")]
    assert heard == [("A", "of a anew"), ("C", "of c anew")]
    assert fits == ["A", "b", "C", "d"] and seen == ["of a anew", "of b", "of c anew", "of d"]


def test_what_each_recording_served_for_is_told_once_in_their_order():
    own = candidates_of()
    other, unused = of(90, "x"), of(80, "y")
    found = choice._sources(own, [own.loops[1], other, unused], [other])
    assert [(u.path, u.sha256, u.fitted, u.held_out, u.role) for u in found] == [
        ("a", "a", 250, 150, "loops"),
        ("b", "b", 170, 130, "loops"),
        ("x", "x", 90, 0, "broadband"),
        ("y", "y", 0, 0, "broadband"),
        ("v", "v", 0, 220, "validation"),
    ]


def test_the_same_data_are_told_with_both_their_names_unless_their_rates_differ():
    first, again = of(30, "a", sha256="s"), of(30, "b", sha256="s")
    choice._check_distinct([first, replace(again, rate_hz=51.0)], [of(40, "c", sha256=""), of(40, "d", sha256="")])
    with pytest.raises(IdentificationError) as caught:
        choice._check_distinct([of(20, "z"), first], [again])
    assert str(caught.value) == (
        "b: the same data as a; give each recording once, and for validation one that is not fitted."
    )


def test_a_model_that_explains_less_than_half_is_told_in_full_of_several_records():
    """Spreads of 3 and 4 about means of their own, 200 and 100 samples; a record without samples counts for nothing."""
    turns = np.where(np.arange(200) % 2, 1.0, -1.0)
    parts = [
        (7.0 + 3.0 * turns, 2.0 * turns),
        (np.zeros(0), np.zeros(0)),
        (-9.0 + 4.0 * turns[:100], 2.5 * turns[:100]),
    ]
    spread, rest = np.sqrt(34 / 3), np.sqrt((8 + 6.25) / 3)
    score = predictions.Score("m", 1.0, 1.0, 1.0, 1.0)
    assert choice._unexplained(score, parts, "somewhere") == (
        f"the recordings do not support a model: the chosen one, m, leaves {rest:.3g} rad rms of {spread:.3g} rad "
        f"somewhere ({100 * rest / spread:.0f} %, at most 50 % is a model)."
    )
    assert choice._unexplained(score, [(m, 0.7 * r) for m, r in parts], "somewhere") == ""


def test_a_line_has_one_slope_for_all_records_and_an_offset_for_each():
    """From the samples that a fit uses; a record that is all unseen has its offset from behind its own transient."""
    units = Units("mV", "um", 0.5)
    loops = [of(200, "a"), of(120, "b")]
    splits = [100, 80]
    unseen = of(60, "v", drive=np.concatenate([np.zeros(10), np.linspace(0, 9, 20), np.linspace(9, 1, 40)]))
    prepared = si_records([r.first(k) for r, k in zip(loops, splits, strict=True)], units)
    lines = predictions.straight_line(prepared, [*loops, unseen], [*splits, 0], units)
    columns = np.zeros((95 + 76, 3))
    columns[:95, 0], columns[95:, 0] = 1e-3 * loops[0].drive[5:100, 0], 1e-3 * loops[1].drive[4:80, 0]
    columns[:95, 1], columns[95:, 2] = 1.0, 1.0
    target = 2e-6 * np.concatenate([loops[0].output[5:100, 0], loops[1].output[4:80, 0]])
    slope, first, second = np.linalg.lstsq(columns, target, rcond=None)[0]
    for line, record, offset in zip(lines, loops, (first, second), strict=False):
        assert_allclose(line.model_rad, slope * 1e-3 * record.drive[:, 0] + offset, rtol=1e-8)
        assert_allclose(line.measured_rad, 2e-6 * record.output[:, 0])
    assert [(line.start, line.split) for line in lines] == [(5, 100), (4, 80), (30, 30)]
    assert np.mean(lines[2].residual_rad[30:]) == pytest.approx(0.0, abs=1e-18)
    with pytest.raises(IdentificationError) as caught:
        predictions.predict(SimpleNamespace(units=units), loops[1], 121)
    assert str(caught.value) == "split 121 does not lie within the 120 samples of b; give a number from 2 to that."


def test_what_is_judged_over_hours_is_told_in_plain_seconds():
    found = predictions.Evidence((("slow.csv", 1234.0), ("fast.csv", 0.5)), "fast.csv", 3e-6, 9e-6)
    assert found.text == "1230 s of 2 recordings, slow.csv (1230 s) and fast.csv (0.5 s)"


def straight():
    """A recording of two periods of a mirror without hysteresis."""
    drive = 50.0 - 50.0 * np.cos(2.0 * np.pi * np.arange(400) / 200.0)
    return recording_from_arrays(np.round(drive, 4), np.round(10.0 * drive, 4), rate_hz=200.0)


@pytest.mark.endurance
def test_a_mirror_without_hysteresis_is_identified_in_the_end(monkeypatch):
    """What is left is rounding: a search that follows it to ever stiffer operators never came back."""
    monkeypatch.setattr(candidates, "_STARTS", 3)
    with no_hang():
        found = choice.identify([straight()], models=STATIC_FORMS, output_unit="urad")
    assert len(found.scores) + len(found.refused) == len(STATIC_FORMS)


def test_no_correlation_is_beyond_one_where_rounding_has_left_a_covariance_without_a_variance():
    covariance = np.array([[0.0, 1e10, 0.0], [1e10, 4.0, -2.0000000001], [0.0, -2.0000000001, 1.0]])
    found = correlation(covariance)
    assert_allclose(found, [[0.0, 1.0, 0.0], [1.0, 1.0, -1.0], [0.0, -1.0, 1.0]])


def test_the_residuals_of_all_recordings_choose_the_model():
    """The first recording alone would choose the other one."""
    fits = [SimpleNamespace(admissible=True, parameter_count=n) for n in (3, 4)]
    one, other = philox(3).standard_normal((2, 1000))
    assert choose_best(fits, [[0.5 * one, 3.0 * other], [one, other]]) == 1
    assert choose_best(fits[::-1], [[one, other], [0.5 * one, 3.0 * other]]) == 0
    assert choose_best(fits, [[0.5 * one], [one]]) == 0


def test_roots_to_the_right_of_the_axis_are_known_by_their_frequency_as_those_to_the_left_are():
    """A real zero with damping -1 has all of its error; a pair of which the real part is small has half of its."""
    linear = LinearPoles(Roots((40.0, 100.0), (1.0, 0.1)), Roots((60.0, 90.0), (-1.0, -0.2)), 3.0)
    names = ("pole 1", "pole 2", "pole 2 damping", "zero 1", "zero 2", "zero 2 damping")
    known = SimpleNamespace(covariance=1e-18 * np.eye(6), standard_errors=np.full(6, 1e-9))
    parameters = [SimpleNamespace(name=name) for name in names]
    fit = joint_fit_of(fit=known, linear=linear, structure=SimpleNamespace(parameters=parameters))
    turn = 2 * np.pi
    response = SimpleNamespace(
        delay_error_s=0.0,
        poles_rad_s=turn * np.array([-10 + 99.5j, -10 - 99.5j, -40.0]),
        poles_error_rad_s=turn * np.array([2.0, 2.0, 3.0]),
        zeros_rad_s=turn * np.array([18 + 88.2j, 18 - 88.2j, 60.0]),
        zeros_error_rad_s=turn * np.array([5.0, 5.0, 7.0]),
    )
    found = np.sqrt(np.diag(candidates._held_covariance(fit, response)))
    half = np.sqrt(0.5)
    assert_allclose(found, [3.0, 2 * half, 2 * half / 100, 7.0, 5 * half, 5 * half / 90], rtol=1e-9)


@pytest.mark.parametrize("scale", [0.98, 1.02])
def test_of_models_alike_in_all_else_the_one_with_the_lower_residual_is_chosen(scale):
    fits = [SimpleNamespace(admissible=True, parameter_count=4)] * 3
    noise, other = philox(4).standard_normal((2, 1000))
    other *= scale * np.sqrt(noise @ noise / (other @ other))  # by less than two standard errors
    best = 1 if scale < 1.0 else 0
    assert choose_best(fits, [[noise], [other], [3.0 * noise]]) == best
    assert choose_best(fits, [[3.0 * noise], [noise], [other]]) == 1 + best


def test_fits_that_fail_are_told_by_model_and_progress_counts_the_starts_of_each(monkeypatch):
    """Twelve starts of Eq. 3, and one of every other model."""
    fails = {"prandtl_ishlinskii_rate", "prandtl_ishlinskii_creep"}

    def fitted(self, model, poles, progress):
        progress(1, 99, f"at {model}")
        if model in fails:
            raise IdentificationError(f"no {model}")
        return SimpleNamespace(name=model)

    monkeypatch.setattr(candidates.Candidates, "_fit", fitted)
    given = dict.fromkeys(candidates.Candidates.__dataclass_fields__)
    made, seen, heard = candidates.Candidates(**given), [], []
    models = ["bouc_wen", "prandtl_ishlinskii_rate", "prandtl_ishlinskii_creep", "prandtl_ishlinskii"]
    fits, failed = made.fit_all(models, lambda *told: seen.append(told), heard.append)
    assert [fit.name for fit in fits] == ["bouc_wen", "prandtl_ishlinskii"] and heard == fits
    assert [(each.model, each.reason) for each in failed] == [(m, f"no {m}") for m in models[1:3]]
    assert seen == [
        (1, 15, "at bouc_wen"),
        (13, 15, "at prandtl_ishlinskii_rate"),
        (13, 15, "prandtl_ishlinskii_rate"),
        (14, 15, "at prandtl_ishlinskii_creep"),
        (14, 15, "prandtl_ishlinskii_creep"),
        (15, 15, "at prandtl_ishlinskii"),
    ]
    with pytest.raises(IdentificationError, match=r"^no prandtl_ishlinskii_rate$"):
        made.fit_all(models[1:3], lambda *told: None, heard.append)
    fails.add("bouc_wen")
    with pytest.raises(IdentificationError, match=r"^no bouc_wen$"):
        made.fit_all(models, lambda *told: None, heard.append)


@pytest.mark.parametrize("with_eq_3", [True, False])
def test_models_side_by_side_begin_in_two_rounds_and_are_heard_of_in_their_own_order(monkeypatch, with_eq_3):
    """Twelve starts of Eq. 3, which goes first; the forms that begin at it come last, the shortest of them before."""

    class Eq3(SimpleNamespace):
        pass

    begun, starts = [], []

    def fitted(self, model, poles, progress):
        begun.append((model, vars(self).get("_static_start")))
        if model in ("linear", "bouc_wen_creep"):
            raise IdentificationError(f"no {model}.")
        return (Eq3 if model.startswith("bouc_wen") else SimpleNamespace)(name=model, poles=poles)

    def start(self, progress, **how):
        starts.append(len(begun))
        raise IdentificationError("no Eq. 3")

    @contextmanager
    def in_turn(jobs, on_turn):
        yield lambda: [on_turn(number) or job() for number, job in enumerate(jobs)]

    monkeypatch.setattr(candidates, "BoucWenFit", Eq3)
    monkeypatch.setattr(candidates, "shared_out", in_turn)
    monkeypatch.setattr(candidates.Candidates, "_fit", fitted)
    monkeypatch.setattr(candidates.Candidates, "_fit_eq_3", start)
    models = ["prandtl_ishlinskii", "linear", "bouc_wen_creep", "bouc_wen_admissible", "bouc_wen_classical", "bouc_wen"]
    if not with_eq_3:
        models.pop()
    one, told, heard = candidates_of(), [], []
    fits, failed = one.fit_all(models, lambda *call: told.append(call), heard.append, side_by_side=True)
    asked = [model for model in models if model not in ("linear", "bouc_wen_creep")]
    assert [(fit.name, fit.poles) for fit in fits] == [(model, None) for model in asked] and heard == fits
    assert [(each.model, each.reason) for each in failed] == [
        ("linear", "no linear."),
        ("bouc_wen_creep", "no bouc_wen_creep."),
    ]
    eq_3 = ["bouc_wen_admissible", "bouc_wen"] if with_eq_3 else ["bouc_wen_admissible"]
    first = [*eq_3, "prandtl_ishlinskii", "linear"]
    order = [*first, "bouc_wen_classical", "bouc_wen_creep"]
    assert [model for model, _ in begun] == order
    efforts = [12 if model in ("bouc_wen", "bouc_wen_admissible") else 1 for model in order]
    total = sum(efforts)
    expected = [(sum(efforts[:k]), total, f"fitting {model}") for k, model in enumerate(order)]
    assert told == [*expected, (total, total, models[-1])] and total == (28 if with_eq_3 else 16)
    known = fits[-1] if with_eq_3 else None  # made in the first round, where it is asked for
    assert [at for _, at in begun] == [None] * len(first) + [known] * 2
    assert starts == ([] if with_eq_3 else [len(first)])


@pytest.mark.parametrize(("model", "admissible"), [("bouc_wen_classical", True), ("bouc_wen_admissible", False)])
def test_joint_forms_are_bounded_where_that_is_asked_for_and_not_by_what_other_models_are_called(
    monkeypatch, model, admissible
):
    class AskedError(Exception):
        pass

    def made(**given):
        raise AskedError(given["admissible"])

    monkeypatch.setattr(choice, "Candidates", made)
    with pytest.raises(AskedError) as told:
        choice.identify([straight()], models=(model,), admissible=admissible, output_unit="urad")
    assert told.value.args == (admissible,)


class ReachedError(Exception):
    """Raised where the fits would begin, with what they would be made of."""


@pytest.mark.parametrize("alone", [True, False])
def test_what_is_fitted_is_the_heads_of_loops_and_whole_periods_of_what_is_a_loop_too(monkeypatch, alone):
    """Two loops, the second of which is broadband as well, beside a broadband record of one period and a half."""
    first, second = of(400, "a"), replace(of(300, "b"), period_samples=50)
    wide, other = replace(of(150, "w"), period_samples=100), of(200, "x", rate_hz=20.0)
    response = [wide] if alone else [wide, second]
    served = choice.roles([first, second])._replace(
        response=response, broadband=[*response, other], loops=[first, second]
    )
    asked = []

    def linear_part(*given):
        asked.append(given)
        return "linear"

    def supported(models, prepared, has_linear):
        asked.append((models, prepared, has_linear))
        return models, []

    def made(**given):
        raise ReachedError(given)

    monkeypatch.setattr(choice, "roles", lambda recordings: served)
    monkeypatch.setattr(choice, "split_points", lambda loops, hold_out, validated: [250, 170])
    monkeypatch.setattr(choice, "fit_linear_part", linear_part)
    monkeypatch.setattr(choice, "supported_models", supported)
    monkeypatch.setattr(choice, "Candidates", made)
    with pytest.raises(ReachedError) as reached:
        choice.identify(
            [first, second, wide, other],
            models=("bouc_wen", "prandtl_ishlinskii", "bouc_wen_admissible"),
            admissible=True,
            seed=5,
            output_unit="urad",
            input_unit="mV",
            hold="first-order",
            validation=[of(220, "v")],
        )
    (given,) = reached.value.args
    (parts, units, models, hold, _), (_, prepared, has_linear) = asked
    assert models == ("bouc_wen_admissible", "prandtl_ishlinskii") and (hold, has_linear) == ("first-order", True)
    expected = [("w", 150, None)] if alone else [("w", 150, 100), ("b", 150, 50)]
    assert [(r.path, r.samples, r.period_samples) for r in parts] == expected
    assert [r.samples for r in given["heads"]] == [250, 170] and given["splits"] == [250, 170]
    assert [r.path for r in given["broadband"]] == ["w"] and given["linear"] == "linear"
    assert [r.path for r in given["validation"]] == ["v"] and [r.path for r in given["loops"]] == ["a", "b"]
    largest = max(np.ptp(first.output[:250]), np.ptp(second.output[:170]))
    assert given["span_rad"] == pytest.approx(1e-6 * largest) and units == Units("mV", "urad")
    assert (given["seed"], given["admissible"], given["hold"]) == (5, True, "first-order")
    assert [r.drive_v.size for r in prepared] == [250, 170]


def test_an_identification_has_the_drives_of_all_loops_and_tests_the_longest_part_that_no_fit_saw(monkeypatch):
    """Two loops and a record for validation: the second loop has the most held-out samples, and the lowest drive."""
    records = [of(10, "a"), of(8, "b"), of(9, "v")]
    ends = [(1, 6), (0, 2), (0, 4)]
    models = [np.array(of(n).output[:, 0]) * size for n, size in ((10, 1.0), (8, 0.5), (9, 30.0))]
    seen = [
        predictions.Prediction(m, m + 1e-3 * np.arange(m.size), start, split, 0)
        for m, (start, split) in zip(models, ends, strict=True)
    ]
    fits = [SimpleNamespace(name=name, rate_limit_v_per_s=limit) for name, limit in (("p", 10.0), ("q", 20.0))]
    prepared = tuple(SimpleNamespace(drive_v=np.array(drive)) for drive in ([-1.0, 3.0], [-4.0, 2.0]))
    line = predictions.Score("straight line", 9.0, 9.0, 90.0, 90.0)
    own = candidates_of(loops=records[:2], splits=[6, 2], validation=(records[2],))

    def scores(self, name, given):
        return line if name == "straight line" else predictions.Score(name, 1.0, 2.0, float(len(name)), 4.0)

    monkeypatch.setattr(candidates.Candidates, "score", scores)
    told = {}

    def saying(name, answer):
        def say(*given):
            told[name] = given
            return answer

        monkeypatch.setattr(choice, name, say)

    names = ("range", "score", "fit", "rate", "split", "set_aside", "held_out", "residual")
    for name in names:
        saying(f"{name}_warnings", [name])
    saying("drift", (7e-6, ["drift"]))
    saying("residual_test", "test")
    saying("straight_line", "line")
    saying("_reason", "It is best.")
    saying("_rests_on", "It rests.")
    saying("_unsupported", "")
    saying("evidence", "evidence")
    others = tuple(replace(p, model_rad=0 * p.model_rad) for p in seen)
    found = choice._identification(own, prepared, fits, [others, tuple(seen)], 1, ["refused"], ("source",), ["note"])
    assert (found.chosen, found.drive_min_v, found.drive_max_v, found.bias_v) == ("q", -4.0, 3.0, -0.5)
    assert (found.rate_limit_v_per_s, found.drift_rad, found.residual) == (20.0, 7e-6, "test")
    assert found.travel_rad == pytest.approx(max(np.ptp(models[0][1:6]), np.ptp(models[1][:2])))
    residual, drive = told["residual_test"]
    assert_allclose(residual, 1e-3 * np.arange(2, 8))
    assert drive.tolist() == records[1].drive[2:, 0].tolist()
    before, after = names[:3], names[4:]
    assert found.warnings == (*before, "drift", "rate", "note", *after)
    assert told["range_warnings"] == ((-4.0, 3.0), 20.0) and told["fit_warnings"] == (fits[1],)
    assert told["rate_warnings"] == (prepared, fits[1]) and told["split_warnings"][1:] == ([6, 2], 1e-3)
    assert told["straight_line"][0] is prepared and told["straight_line"][2] == [6, 2, 0]
    assert told["score_warnings"] == (found.scores[1], line) and told["held_out_warnings"][2] == (-4.0, 3.0)
    assert [each.model for each in found.scores] == ["p", "q"] and found.straight_line is line
    assert found.reason == "It is best. It rests." and found.refused == ("refused",) and found.sources == ("source",)
    assert [r.path for r in found.recordings] == ["a", "b", "v"] and found.predictions[1] == tuple(seen)
