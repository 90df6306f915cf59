"""The variants of a mission's mirror, assembled once, and the words that name them."""

import json
import pickle

import numpy as np
import pytest

from microrad import mirror
from microrad.mirror import Variant, hysteresis
from microrad.mission.file import load_mission
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
