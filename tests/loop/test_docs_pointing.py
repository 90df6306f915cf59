"""The examples of docs/pointing.md run as they stand, in one session, from the project's folder."""

import re

import several_axes
from places import ROOT


def test_every_controllers_worked_example_runs(tmp_path, monkeypatch, capsys):
    (tmp_path / "missions").symlink_to(ROOT / "missions")
    (tmp_path / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
    (tmp_path / "two-axes-mission.toml").write_text(several_axes.mission_text(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "pointing.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(blocks) == 14
    session: dict[str, object] = {}
    for block in blocks:
        exec(block, session)
    printed = capsys.readouterr().out
    assert printed.count("\n") == 16 and "nan" not in printed
    assert "hysteresis is a Bouc-Wen model" in printed
    assert "mean of an axis over 1 s: 5.8005 urad, by the rational filter +9.7%" in printed
    assert session["tuned"].margins.modulus >= 0.5 and session["lqg"].residual_rms_rad >= session["bound"]
    assert session["both"].margins.modulus >= 0.5 and session["left"].holds
    assert session["ahead"].forward.bank == session["axes"].loop.mirror.bank
