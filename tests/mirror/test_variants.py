"""The variants of a mission's mirror, assembled once, and the words that name them."""

import json
import pickle

import numpy as np
import pytest

from microrad import mirror
from microrad.mirror import Variant, hysteresis
from microrad.mission.file import load_mission
from microrad.mission.tables.mirror import CreepTable, PrandtlIshlinskiiTable
from shipped import SHIPPED


def mission(angle="line-of-sight", **changes):
    m = load_mission(SHIPPED).mission.with_value("conventions.mirror_angle", angle)
    return m.model_copy(update={"mirror": m.mirror.model_copy(update=changes)})


def test_a_variant_is_its_text_wherever_it_is_written():
    assert [f"{v}" for v in Variant] == [str(v) for v in Variant] == ["given", "comparison", "no hysteresis"]
    assert f"{Variant.STRAIGHT!r} {Variant.GIVEN:>6s}" == "'no hysteresis'  given"
    assert json.dumps({Variant.GIVEN: Variant.STRAIGHT}) == '{"given": "no hysteresis"}'
    assert pickle.loads(pickle.dumps(Variant.GIVEN)) is Variant.GIVEN
    assert {"comparison": 1}[Variant.COMPARISON] == {Variant.COMPARISON: 1}["comparison"] == 1
    assert np.array([Variant.GIVEN]).dtype == np.array(["given"]).dtype


def test_a_variant_is_stored_as_its_text(tmp_path):
    import h5py

    with h5py.File(tmp_path / "x.h5", "w") as file:
        file.attrs["mirror"] = str(Variant.STRAIGHT)
        file.create_group(Variant.GIVEN)
    with h5py.File(tmp_path / "x.h5") as file:
        assert file.attrs["mirror"] == "no hysteresis" and list(file) == ["given"]


@pytest.mark.promise("mirror-file-8", "mirror-file-12", "mirror-file-23")
@pytest.mark.parametrize(("angle", "times"), [("line-of-sight", 1.0), ("optical", 1.0), ("mechanical", 2.0)])
def test_the_line_of_sight_moves_by_twice_a_mechanical_angle(angle, times):
    parts = mirror.of(mission(angle))
    assert tuple(parts.own) == tuple(Variant) and set(parts.line_of_sight) == set(Variant)
    assert parts.line_of_sight_per_own == times
    for variant, axis in parts.own.items():
        turned = parts.line_of_sight[variant]
        assert turned.model == hysteresis.scaled(axis.model, times)
        assert axis.plant.inverse == (axis.model,) and turned.plant.inverse == (turned.model,)
        assert (turned is axis) == (times == 1.0)
    assert parts.own[Variant.GIVEN].model == hysteresis.BoucWen(
        0.089e-3, -2.96e-7, -0.048e-3, 0.00047, 38.421, 34.635, 3770.0, 6.0
    )
    assert parts.own[Variant.COMPARISON].model.epsilon_rad_v == -0.022e-3
    assert parts.own[Variant.STRAIGHT].model == hysteresis.gain_only(parts.own[Variant.GIVEN].model)
    assert parts.drive_range_v == (-6.0, 6.0)


def test_a_mission_without_a_comparison_has_two_variants():
    parts = mirror.of(mission(comparison=None))
    assert tuple(parts.own) == (Variant.GIVEN, Variant.STRAIGHT)
    assert tuple(parts.line_of_sight) == (Variant.GIVEN, Variant.STRAIGHT)


def test_a_mirror_of_numbers_all_unlike_has_each_of_its_variants_by_its_own():
    """A mechanical angle, a Prandtl-Ishlinskii mirror with creep about a bias, and an amplitude between its plays."""
    given = mission("mechanical")
    plays = {"thresholds_v": (0.0, 0.5, 2.0), "weights_rad_v": (4e-5, 1e-5, 5e-6), "widening_s": 0.0}
    table = given.mirror.model_copy(
        update={
            "bouc_wen": None,
            "prandtl_ishlinskii": PrandtlIshlinskiiTable.model_construct(**plays),
            "creep": CreepTable.model_construct(time_constants_s=(0.5, 4.0), weights_rad_v=(1e-6, -2e-6)),
            "bias_v": 4.5,
            "drive_min_v": 1.25,
            "drive_max_v": 11.0,
        }
    )
    parts = mirror.of(
        given.model_copy(
            update={"mirror": table, "scenario": given.scenario.model_copy(update={"amplitude_rad": 1e-4})}
        )
    )
    own = hysteresis.PrandtlIshlinskii((0.0, 0.5, 2.0), (4e-5, 1e-5, 5e-6))
    assert parts.table is table and parts.line_of_sight_per_own == 2.0
    assert parts.drive_range_v == (-3.25, 6.5)
    assert parts.own[Variant.GIVEN].model == own
    assert parts.line_of_sight[Variant.GIVEN].model == hysteresis.scaled(own, 2.0)
    assert parts.own[Variant.STRAIGHT].model.d1_rad_v == pytest.approx(5.5e-5, rel=1e-12)
    # 100 urad outside are 50 urad of tilt: 20 up to 0.5 V, the other 30 at 50 urad/V
    assert parts.line_of_sight[Variant.STRAIGHT].model.d1_rad_v == pytest.approx(1e-4 / 1.1, rel=1e-12)
    for found, times in ((parts.own, 1.0), (parts.line_of_sight, 2.0)):
        for axis in found.values():
            assert axis.plant.inverse == (axis.model,)
            np.testing.assert_allclose(axis.plant.C[0, -2:], [times * 1e-6, times * -2e-6], rtol=1e-12)
            np.testing.assert_allclose(np.diag(axis.plant.A)[-2:], [-2.0, -0.25], rtol=1e-12)
    assert parts.own[Variant.COMPARISON].model.bias_v == 4.5
