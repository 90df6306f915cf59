"""The examples of docs/link.md run as they stand, in one session, and print what stands below each."""

import re

from places import ROOT


def test_every_example_prints_what_stands_below_it(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    text = (ROOT / "docs" / "link.md").read_text(encoding="utf-8")
    examples = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", text, flags=re.DOTALL)
    assert len(examples) == text.count("```python") == 10
    session: dict[str, object] = {}
    for code, printed in examples:
        exec(code, session)
        assert capsys.readouterr().out == printed
