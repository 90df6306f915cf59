"""The examples of docs/pointing.md run as they stand, in one session, from the project's folder."""

import re

from places import ROOT


def test_every_controllers_worked_example_runs(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    text = (ROOT / "docs" / "pointing.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(blocks) == 8
    session: dict[str, object] = {}
    for block in blocks:
        exec(block, session)
    printed = capsys.readouterr().out
    assert printed.count("\n") == 8 and "nan" not in printed
    assert session["tuned"].margins.modulus >= 0.5 and session["lqg"].residual_rms_rad >= session["bound"]
