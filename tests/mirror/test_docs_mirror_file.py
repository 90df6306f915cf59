"""docs/mirror-file.md names every key of a mirror file in its own section, and each of its examples loads."""

import re
import tomllib

import numpy as np
import pytest

from microrad.mirror import coupled
from microrad.mission.file import load_coupled_mirror, load_mirror
from microrad.mission.tables import coupled_mirror, coupled_parts
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
    "Version 2: root of the file": coupled_mirror.CoupledMirror,
    "Version 2: `[actuators.N]`": coupled_parts.ActuatorTable,
    "Version 2: `[outputs.N]`": coupled_parts.OutputTable,
    "Version 2: `[recording]`": coupled_parts.RecordingTable,
    "Version 2: `[modes]`": coupled_parts.ModesTable,
    "Version 2: `[matrices]`": coupled_parts.MatricesTable,
    "Version 2: `[hysteresis.N]`": coupled_parts.HysteresisTable,
    "Version 2: `[uncertainty]`": coupled_parts.UncertaintyTable,
}
OF_SEVERAL_AXES = next(text for text in EXAMPLES if text.startswith("version = 2"))
OF_ONE_AXIS = [text for text in EXAMPLES if text != OF_SEVERAL_AXES]


def section(title):
    return PAGE.split(f"\n## {title}\n")[1].split("\n## ")[0]


@pytest.mark.parametrize(("title", "table"), SECTIONS.items())
def test_every_key_has_its_row_and_no_other(title, table):
    rows = re.findall(r"(?m)^\| `([A-Za-z_0-9]+)` \|", section(title))
    keys = [info.alias or name for name, info in table.model_fields.items()]
    assert sorted(rows) == sorted(keys)


def test_comparison_names_its_tables():
    for key in mirror_table.Comparison.model_fields:
        assert f"`[comparison.{key}]`" in section("`[comparison]`")


@pytest.mark.parametrize("number", range(len(OF_ONE_AXIS)))
def test_examples_load(number, tmp_path):
    assert len(OF_ONE_AXIS) == 3
    path = tmp_path / "mirror.toml"
    path.write_text(OF_ONE_AXIS[number], encoding="utf-8")
    assert load_mirror(path).mirror.name == re.search('name = "(.*)"', OF_ONE_AXIS[number])[1]


def test_the_example_of_several_axes_runs_as_the_page_says(tmp_path, monkeypatch):
    """The lines of the page: actuator 1 tilts about x, by more for a larger drive, and little is seen elsewhere."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "two-axes.toml").write_text(OF_SEVERAL_AXES, encoding="utf-8")
    found: dict = {}
    exec(python("coupled.of"), found)  # the page's own lines
    mirror, drive_v, tilts = found["mirror"], found["drive_v"], found["tilts_and_piston"]
    sensors = coupled.tilts_and_piston(mirror.outputs)
    small = mirror.response(1e-3 * drive_v) @ sensors.T
    static = 0.1e-3 / np.hypot(900.0, 18.0) * 900.0 / np.hypot(900.0, 18.0) * 900.0  # rad/V, state 1 being -w B / |p|^2
    last = slice(1600, None)  # one period of the drive

    def amplitude(signal):
        return np.ptp(signal[last]) / 2

    assert amplitude(small[:, 0]) == pytest.approx(0.02 * static, rel=0.005)
    softened = amplitude(tilts[:, 0]) / (20.0 * static)
    assert 1.08 < softened < 1.11  # less than a tenth of the stiffness at 20 V, 1 / 0.9 without thresholds
    assert amplitude(tilts[:, 1]) < 0.05 * amplitude(tilts[:, 0])
    assert np.abs(tilts[:, 2]).max() < 1e-12
    again = coupled.of(load_coupled_mirror("mirror.toml", text=found["text"]))
    np.testing.assert_array_equal(again.response(drive_v), found["output"])


def test_the_correlation_of_the_example_is_that_of_its_factor():
    known = coupled.of(load_coupled_mirror("mirror.toml", text=OF_SEVERAL_AXES)).known
    below = known.correlation[np.tril_indices(4, -1)]
    np.testing.assert_allclose(below, [0.1, -0.2, 0.6, 0.0, 0.3, 0.1], atol=1e-14)
    np.testing.assert_allclose(np.diag(known.correlation), 1.0, atol=1e-14)


def test_a_correlation_of_two_decimals_becomes_one_that_can_be():
    """Rounded to two decimals the correlations may not be those of any numbers; those nearby have a diagonal of 1."""
    lines = ("  0.1,\n  -0.2, 0.6,\n  0.0, 0.3, 0.1,\n", "  0.71,\n  0.71, 0.0,\n  0.0, 0.0, 0.0,\n")
    text = OF_SEVERAL_AXES.replace(*lines)
    known = coupled.of(load_coupled_mirror("mirror.toml", text=text)).known
    np.testing.assert_allclose(np.diag(known.correlation), 1.0, atol=1e-14)
    assert np.abs(known.correlation[1, 0] - 0.71) < 0.01
    assert np.linalg.eigvalsh(known.correlation)[0] > -1e-12


def python(part):
    """The Python of the page that holds a text."""
    return next(code for code in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL) if part in code)


def values(title):
    """Key and the example of its row, as lines of TOML."""
    rows = re.findall(r"(?m)^\| `([A-Za-z_0-9]+)` \|.*\| `([^`|]+)` \|$", section(title))
    return {key: example for key, example in rows if not example.startswith("[") or example[1] in '"-0123456789['}


OF_BOUC_WEN = ("d1", "d2", "epsilon", "delta", "alpha", "beta", "gamma", "eta", "exponent", "bias")
LEFT_OUT = {  # keys that do not go with others of their table
    "Version 2: `[hysteresis.N]`": [OF_BOUC_WEN],
    "Version 2: `[uncertainty]`": [("factor",), ("correlation",)],
}


@pytest.mark.parametrize(
    "title",
    [t for t in SECTIONS if t not in ("`[linear]`", "`[uncertainty]`") and "oot of the file" not in t],
)
def test_examples_of_the_rows_fit_their_keys(title):
    rows = values(title)
    for left_out in LEFT_OUT.get(title, [()]):
        text = "\n".join(f"{key} = {example}" for key, example in rows.items() if key not in left_out)
        assert SECTIONS[title].model_validate(tomllib.loads(text))


def test_import_of_the_page_is_a_call_that_there_is():
    from microrad.export import linear_import

    made = python("import_mat").split("text = ")[0]
    found: dict = {}
    exec(made, found)  # the page's own lines
    assert isinstance(found["given"], linear_import.Given) and found["import_mat"] is linear_import.import_mat
