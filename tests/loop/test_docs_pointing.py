"""The examples of docs/pointing.md run as they stand, in one session, from the project's folder."""

import re
from functools import partial

import pytest

import several_axes
from microrad.loop import control
from microrad.loop.control import tuning
from microrad.loop.controller_study import designs
from microrad.loop.coupled_study import designs as coupled_designs
from microrad.mission.file import load_mission
from places import ROOT


@pytest.mark.promise("readme-11", "readme-32")
@pytest.mark.promise(
    "pointing-15",
    "pointing-16",
    "pointing-20",
    "pointing-27",
    "pointing-36",
    "pointing-45",
    "pointing-59",
    "pointing-70",
    "pointing-76",
    "pointing-83",
    "pointing-86",
    "pointing-111",
)
def test_every_controllers_worked_example_runs(tmp_path, monkeypatch, capsys):
    (tmp_path / "missions").symlink_to(ROOT / "missions")
    (tmp_path / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
    (tmp_path / "two-axes-mission.toml").write_text(several_axes.mission_text(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "pointing.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(blocks) == 15
    budget, table = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    shipped = (ROOT / "missions" / "leo-geo.toml").read_text(encoding="utf-8")
    asked = load_mission("m.toml", text=shipped + budget).mission.error_budget
    assert (
        asked.with_loop and list(asked.sources) == ["telescope_alignment"] and list(asked.requirements) == ["code_word"]
    )
    named = shipped.replace("[fine_pointing]\n", table, 1)
    assert load_mission(tmp_path / "m.toml", text=named).mission.fine_pointing.mirror_file == "two-axes.toml"
    monkeypatch.setattr(control, "tune", partial(control.tune, survey=20))  # what a search ends at has tests of its own
    monkeypatch.setattr(tuning, "STARTS", 2)
    monkeypatch.setattr(coupled_designs, "STARTS", 1)
    monkeypatch.setattr(coupled_designs, "MODELS", 2)
    session: dict[str, object] = {}
    for block in blocks:
        exec(block, session)
    printed = capsys.readouterr().out
    assert printed.count("\n") == 17 and "nan" not in printed
    assert "hysteresis is a Bouc-Wen model" in printed
    assert "mean of an axis over 1 s: 5.8005 urad, by the rational filter +9.7%" in printed
    constants = {name: getattr(control, name) for name in dir(control) if name.isupper()}
    shown = {each.name for name, each in constants.items() if f"control.tune(control.{name}, " in text}
    assert {each.name for each in designs.families(session["scene"].table)} == shown
    assert session["lines"].name == "PI + peaks"
    assert session["tuned"].margins.modulus >= 0.5 and session["lqg"].residual_rms_rad >= session["bound"]
    assert session["both"].margins.modulus >= 0.5 and session["left"].holds
    assert session["ahead"].forward.bank == session["axes"].loop.mirror.bank
