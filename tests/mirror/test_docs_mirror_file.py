"""docs/mirror-file.md names every key of a mirror file in its own section, and each of its examples loads."""

import re

import pytest

from microrad.mission.file import load_mirror
from microrad.mission.tables import mirror as mirror_table
from places import ROOT

PAGE = (ROOT / "docs" / "mirror-file.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
SECTIONS = {
    "Root of the file": mirror_table.Mirror,
    "`[linear]`": mirror_table.LinearPart,
    "`[bouc_wen]`": mirror_table.BoucWenTable,
    "`[prandtl_ishlinskii]`": mirror_table.PrandtlIshlinskiiTable,
    "`[creep]`": mirror_table.CreepTable,
    "`[uncertainty]`": mirror_table.Uncertainty,
}


def section(title):
    return PAGE.split(f"\n## {title}\n")[1].split("\n## ")[0]


@pytest.mark.parametrize(("title", "table"), SECTIONS.items())
def test_every_key_has_its_row_and_no_other(title, table):
    rows = re.findall(r"(?m)^\| `([a-z_0-9]+)` \|", section(title))
    keys = [info.alias or name for name, info in table.model_fields.items()]
    assert sorted(rows) == sorted(keys)


def test_comparison_names_its_tables():
    for key in mirror_table.Comparison.model_fields:
        assert f"`[comparison.{key}]`" in section("`[comparison]`")


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_examples_load(number, tmp_path):
    assert len(EXAMPLES) == 3
    path = tmp_path / "mirror.toml"
    path.write_text(EXAMPLES[number], encoding="utf-8")
    assert load_mirror(path).mirror.name == re.search('name = "(.*)"', EXAMPLES[number])[1]


def values(title):
    """Key and the example of its row, as lines of TOML."""
    rows = re.findall(r"(?m)^\| `([a-z_0-9]+)` \|.*\| `([^`|]+)` \|$", section(title))
    return {key: example for key, example in rows if not example.startswith("[") or example[1] in '"-0123456789'}


@pytest.mark.parametrize(
    "title", [t for t in SECTIONS if t not in ("`[linear]`", "`[uncertainty]`", "Root of the file")]
)
def test_examples_of_the_rows_fit_their_keys(title):
    import tomllib

    text = "\n".join(f"{key} = {example}" for key, example in values(title).items())
    assert SECTIONS[title].model_validate(tomllib.loads(text))


def test_import_of_the_page_is_a_call_that_there_is():
    from microrad.export import linear_import

    python = re.search(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)[1]
    made = python.split("text = ")[0]
    found: dict = {}
    exec(made, found)  # the page's own lines
    assert isinstance(found["given"], linear_import.Given) and found["import_mat"] is linear_import.import_mat
