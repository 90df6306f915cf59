"""Mirrors of several axes on the command line: units and matrices are written, and what does not fit is refused."""

import fmpy
import pytest
from fmpy.validation import validate_fmu

import designs
from microrad.export import choice
from microrad.export.flight import build
from microrad.export.linear_import.matlab import load
from several_axes import TEXT, mission_text, two_axes


@pytest.fixture
def here(folder):
    (folder / "mission.toml").write_text(mission_text(), encoding="utf-8")
    (folder / "two-axes.toml").write_text(TEXT, encoding="utf-8")
    return folder


@pytest.mark.promise("mirror-file-30")
@pytest.mark.promise("export-32")
@pytest.mark.skipif(build.compiler() is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("fmi", "first"), [("2.0", "command_v[1]"), pytest.param("3.0", "command_v", marks=pytest.mark.endurance)]
)
def test_a_unit_of_all_axes_is_written(here, call, fmi, first):
    done = call("export", "fmu", "mission.toml", "--mirror", "two-axes.toml", "--fmi", fmi)
    assert done.code == 0, done.err
    path = here / "mission-mirror.fmu"
    assert validate_fmu(str(path)) == []
    found = fmpy.read_model_description(path)
    names = [v.name for v in found.modelVariables]
    assert names[1] == first and any(name.startswith("mirror_m") for name in names)
    assert found.modelName == "Two axes on a hysteretic spring"
    weights = "prandtl_ishlinskii[2].weight" + ("[3]" if fmi == "2.0" else "")
    (weight,) = (v for v in found.modelVariables if v.name == weights)
    assert (weight.start.split()[-1], weight.unit) == ("0.03", None)


@pytest.mark.promise("mirror-file-30")
@pytest.mark.promise("export-32")
@pytest.mark.promise("pointing-77")
@pytest.mark.skipif(build.compiler() is None, reason="no C compiler")
def test_a_controller_of_all_axes_goes_out_with_its_loop(here, call, monkeypatch):
    asked, designed = [], designs.of_three_actuators()
    monkeypatch.setattr(choice, "choose_coupled", lambda *given: asked.append(given) or designed)
    command = ("mission.toml", "--mirror", "two-axes.toml", "--controller", "LQG")
    done = call("export", "fmu", *command, "--fmi", "3.0")
    assert done.code == 0, done.err
    shapes = {v.name: v.shape for v in fmpy.read_model_description(here / "mission-lqg_loop.fmu").modelVariables}
    assert (shapes["error_rad"], shapes["command_v"], shapes["mirror_m"]) == ((2,), (3,), (3,))
    done = call("export", "matrices", *command)
    assert done.out == "mission.mat written: mirror, mirror_at_rest, sampled_plant, controller, loop\n"
    assert load(here / "mission.mat")["controller"].fields["C"].shape[0] == 3
    assert [(given[1].mirror.name, given[2]) for given in asked] == [("Two axes on a hysteretic spring", "LQG")] * 2


@pytest.mark.promise("mirror-file-30")
def test_matrices_of_all_axes_are_written(here, call):
    done = call("export", "matrices", "mission.toml", "--mirror", "two-axes.toml")
    assert (done.code, done.out) == (0, "mission.mat written: mirror, mirror_at_rest\n")
    fields = load(here / "mission.mat")["mirror"].fields
    assert fields["A"].shape == (4, 4) and fields["C"].shape == (3, 4)
    assert (fields["D"] == two_axes().mirror.linear_loop.D).all()


@pytest.mark.parametrize(
    ("change", "command", "why"),
    [
        (("", ""), ("fmu", "--loop", "control"), "the loop 'control' is of one axis"),
        (('bias = "50 V"    ', 'bias = "40 V"    '), ("fmu",), "rest at 40 V, 50 V"),
        (('bias = "50 V"    ', 'bias = "40 V"    '), ("matrices",), "rest at 40 V, 50 V"),
        (("", ""), ("matrices", "--controller", "PID"), "'PID' is no controller of a mirror of several axes"),
    ],
)
def test_what_does_not_fit_is_refused(here, refused, change, command, why):
    (here / "two-axes.toml").write_text(TEXT.replace(*change, 1) if change[0] else TEXT, encoding="utf-8")
    told = refused("export", *command[:1], "mission.toml", "--mirror", "two-axes.toml", *command[1:])
    assert why in " ".join(told.split())
    assert sorted(each.name for each in here.iterdir()) == ["mission.toml", "two-axes.toml"]


def test_a_unit_of_displacements_and_angles_is_refused(here, refused):
    angle = '[outputs.4]\nname = "autocollimator"\nquantity = "angle"\n\n[recording]\n'
    row = "  [-2.6e-6, 0.0, 1.5e-6, 0.0],\n"
    mixed = TEXT.replace("[recording]\n", angle).replace(row, row + "  [0.0, 0.0, 2.0e-6, 0.0],\n")
    (here / "two-axes.toml").write_text(mixed, encoding="utf-8")
    told = " ".join(refused("export", "fmu", "mission.toml", "--mirror", "two-axes.toml").split())
    assert "the outputs of 'Two axes on a hysteretic spring' are displacements and angles" in told
    assert "leave the angles out of the mirror file" in told
    assert sorted(each.name for each in here.iterdir()) == ["mission.toml", "two-axes.toml"]
