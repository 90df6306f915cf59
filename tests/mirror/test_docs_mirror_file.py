"""docs/mirror-file.md names every key of a mirror file in its own section, and each of its examples loads."""

import re
import tomllib

import numpy as np
import pytest

from microrad.loop import control
from microrad.mirror import coupled, hysteresis
from microrad.mirror import model as mirror
from microrad.mission.fields import Several, rule_of_field
from microrad.mission.file import MissionError, load_coupled_mirror, load_mirror
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


@pytest.mark.promise("mirror-file-5", "readme-33", "export-40")
@pytest.mark.parametrize(("title", "table"), SECTIONS.items())
def test_every_key_has_its_row_and_no_other(title, table):
    rows = re.findall(r"(?m)^\| `([A-Za-z_0-9]+)` \|", section(title))
    keys = [info.alias or name for name, info in table.model_fields.items()]
    assert sorted(rows) == sorted(keys)


@pytest.mark.promise("mirror-file-23")
def test_comparison_names_its_tables():
    for key in mirror_table.Comparison.model_fields:
        assert f"`[comparison.{key}]`" in section("`[comparison]`")


@pytest.mark.promise("mirror-file-25", "mirror-file-26", "mirror-file-62")
@pytest.mark.parametrize("number", range(len(OF_ONE_AXIS)))
@pytest.mark.promise("mirror-file-58")
def test_examples_load(number, tmp_path):
    assert len(OF_ONE_AXIS) == 3
    path = tmp_path / "mirror.toml"
    path.write_text(OF_ONE_AXIS[number], encoding="utf-8")
    assert load_mirror(path).mirror.name == re.search('name = "(.*)"', OF_ONE_AXIS[number])[1]


@pytest.mark.promise("mirror-file-28", "mirror-file-29", "mirror-file-32", "mirror-file-63")
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


@pytest.mark.promise("mirror-file-51")
@pytest.mark.promise("campaigns-14")
def test_the_correlation_of_the_example_is_that_of_its_factor():
    known = coupled.of(load_coupled_mirror("mirror.toml", text=OF_SEVERAL_AXES)).known
    below = known.correlation[np.tril_indices(4, -1)]
    np.testing.assert_allclose(below, [0.1, -0.2, 0.6, 0.0, 0.3, 0.1], atol=1e-14)
    np.testing.assert_array_equal(np.triu(known.factor, 1), 0.0)
    assert np.all(np.diag(known.factor) > 0.0)
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


@pytest.mark.promise(
    "mirror-file-41",
    "mirror-file-42",
    "mirror-file-43",
    "mirror-file-44",
    "mirror-file-46",
    "mirror-file-49",
    "mirror-file-51",
)
@pytest.mark.parametrize(
    "title",
    [t for t in SECTIONS if t not in ("`[linear]`", "`[uncertainty]`") and "oot of the file" not in t],
)
@pytest.mark.promise("mirror-file-59")
def test_examples_of_the_rows_fit_their_keys(title):
    rows = values(title)
    for left_out in LEFT_OUT.get(title, [()]):
        text = "\n".join(f"{key} = {example}" for key, example in rows.items() if key not in left_out)
        assert SECTIONS[title].model_validate(tomllib.loads(text))


UNITS = {"text": None, "list of text": None, "SI": "", "list": "", "list of rows": "", "list, SI": "", "angle": "rad"}
CHECKED_BESIDE = {  # what the words of the page are where a check of the whole table says more than the rule of the key
    ("`[linear]`", "pole_dampings"): (0.0, None, 1.0),
    ("`[prandtl_ishlinskii]`", "thresholds"): (None, None, None),
}
BEHIND_OTHER_KEYS = {  # bounds that are another key's, or of the table; the refusals are read elsewhere
    *("name", "composition", "bias", "drive_min", "drive_max", "numerator", "denominator", "normalise_at", "alpha"),
    *("parameters", "quantity", "position", "factor", "model", "modes", "version"),
    *("decay", "frequency", "excited_to", "d1", *"BCDEFGK"),
}


def bounds(text):
    """What the words of a page say of a number: above, least, most, whether it is a list that rises."""
    span = re.search(r"(-?[0-9]+) to ([0-9]+)", text)
    above, least, most = (re.search(rf"{word} ([0-9.e]+|pi/2)", text) for word in ("above", "at least", "at most"))

    def number(found):
        return None if found is None else np.pi / 2 if found[1] == "pi/2" else float(found[1])

    ends = (float(span[1]), float(span[2])) if span else (number(least), number(most))
    return (number(above), *ends, "rising" in text)


@pytest.mark.promise(
    "mirror-file-12",
    "mirror-file-14",
    "mirror-file-17",
    "mirror-file-20",
    "mirror-file-22",
    "mirror-file-24",
    "mirror-file-40",
    "mirror-file-41",
    "mirror-file-42",
    "mirror-file-43",
    "mirror-file-44",
    "mirror-file-46",
    "mirror-file-49",
    "mirror-file-51",
)
@pytest.mark.parametrize(("title", "table"), SECTIONS.items())
@pytest.mark.promise("mirror-file-59", "mirror-file-60")
def test_units_bounds_and_defaults_of_the_rows_are_those_of_the_keys(title, table):
    rows = re.findall(
        r"(?m)^\| `([A-Za-z_0-9]+)` \|([^|]*)\|((?:[^|]|\|[^ ][^|]*\|)*)\|([^|]*)\|[^|\n]*\|$", section(title)
    )
    infos = {info.alias or name: info for name, info in table.model_fields.items()}
    assert {key for key, *_ in rows} == set(infos)
    for key, of, meaning, told in rows:
        rule, unit = rule_of_field(infos[key]), of.strip()
        if rule is not None and not hasattr(rule, "shown"):
            each = rule.each if isinstance(rule, Several) else rule
            wanted = UNITS.get(unit, unit.removeprefix("list of two, ").removeprefix("list, "))
            assert each.unit == wanted, key
            assert unit.startswith("list") == (isinstance(rule, Several) and key not in "BCDEFGK"), key
            if key not in BEHIND_OTHER_KEYS:
                *said, rising = bounds(told)
                assert tuple(said) == CHECKED_BESIDE.get((title, key), (each.above, each.least, each.most)), key
                assert rising == getattr(rule, "rising", False), key
        else:
            assert unit in ("text", "list of text", "table", "tables", "one of two words", "one of three words")
        if found := re.search("left out ([0-9])", meaning):
            assert infos[key].default in (None, float(found[1])), key  # None: what stands for it is looked at below
        assert infos[key].is_required() or "left out" in meaning or key in OPTIONAL, key


OPTIONAL = {  # one of several forms, or of one composition or model alone, as the bounds of their rows say
    *("poles", "pole_dampings", "zero_dampings", "numerator", "denominator", "linear", "bouc_wen"),
    *("prandtl_ishlinskii", "thresholds", "weights", "d1", "epsilon", "alpha", "beta", "reach", "rate_limit"),
    *("factor", "correlation", *"BCDEFGK"),
}


@pytest.mark.promise("mirror-file-49", "mirror-file-45", "mirror-file-40")
def test_what_is_left_out_of_a_file_of_several_axes_is_nothing():
    """Matrices are zero, a Bouc-Wen element has the exponent 1, plays neither widen nor have a polynomial."""
    bouc_wen = '[hysteresis.2]\nmodel = "bouc-wen"\nd1 = 0.02\nepsilon = -0.01\nalpha = "2 1/V"\nbeta = "0.5 1/V"\n'
    own = OF_SEVERAL_AXES.partition("[hysteresis.2]")[0] + bouc_wen
    found = coupled.of(load_coupled_mirror("mirror.toml", text=own))
    m = found.mirror
    for name, shape in {"D": (3, 2), "G": (2, 2), "K": (3, 2)}.items():
        assert f"\n{name} = " not in own and getattr(m, name).shape == shape and not getattr(m, name).any()
    assert found.known is None
    assert m.bouc_wen == (hysteresis.BoucWen(0.02, 0.0, -0.01, 0.0, 2.0, 0.5, np.inf, 0.0, 0.0, 0.0, 1.0),)
    (play,) = m.plays
    assert (play.widening_s, play.polynomial_rad, play.reach_v) == (0.0, (0.0, 0.0, 0.0), np.inf)
    still = re.sub(r"\[modes\].*?(?=\[matrices\])", "", OF_SEVERAL_AXES.partition("[hysteresis.1]")[0], flags=re.DOTALL)
    straight = re.sub(
        r"\[matrices\].*", "[matrices]\nD = [[1e-6, 0.0], [0.0, 1e-6], [0.0, 0.0]]\n", still, flags=re.DOTALL
    )
    without = coupled.of(load_coupled_mirror("mirror.toml", text=straight)).mirror
    assert without.A.shape == (0, 0) and without.bank == () and without.D[1, 1] == 1e-6


def built(text, tmp_path):
    """The mirror that is made of a file of one axis."""
    path = tmp_path / "mirror.toml"
    path.write_text(text, encoding="utf-8")
    table = load_mirror(path).mirror
    return mirror.from_mission(table, mirror.hysteresis_model(table, table.rate_limit_v_s, table.bias_v))


@pytest.mark.promise("mirror-file-3", "mirror-file-4")
@pytest.mark.parametrize(
    ("old", "new", "refused"),
    [
        ('"2.5 mrad"', '"0.1 deg"', ""),
        ('"2.5 mrad"', '"100 mdeg"', ""),
        ('"2.5 mrad"', '"515662 marcsec"', ""),
        ('"2.5 mrad"', '"2500urad"', ""),
        ('"2.5 mrad"', '"2.5  mrad"', "where a unit should stand"),
        ('"2.5 mrad"', "2.5", "is a number without a unit"),
        ('"2.5 mrad"', '"2,5 mrad"', "has a comma"),
        ('"2.5 mrad"', '"inf mrad"', "does not begin with a plain number"),
        ('"2.5 mrad"', '"5/2 mrad"', "where a unit should stand"),
        ("[0.03, 1.0]", '["0.03", 1.0]', "is not a plain number"),
        ("[0.03, 1.0]", '["0.03 rad", 1.0]', "is not a plain number"),
    ],
)
def test_a_value_of_a_mirror_is_written_as_the_page_says(old, new, refused, tmp_path):
    text = OF_ONE_AXIS[0]
    assert old in text
    path = tmp_path / "mirror.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    if refused:
        with pytest.raises(MissionError, match=refused):
            load_mirror(path)
    else:
        assert load_mirror(path).mirror.travel_rad == pytest.approx(2.5e-3, rel=0.5)


@pytest.mark.promise("mirror-file-4")
@pytest.mark.parametrize(("title", "key"), [("`[bouc_wen]`", "exponent"), ("`[linear]`", "numerator")])
def test_exponent_and_coefficients_stand_without_quotes(title, key):
    rule = rule_of_field(SECTIONS[title].model_fields[key])
    value = 2.0 if key == "exponent" else [2.0]
    assert rule.read(value) in (2.0, (2.0,))
    with pytest.raises(ValueError, match="is not a plain number"):
        rule.read("2.0" if key == "exponent" else ["2.0"])


@pytest.mark.promise("mirror-file-9", "mirror-file-15", "mirror-file-14")
def test_frequency_and_damping_of_a_root_are_those_of_s_in_rad_per_second():
    (real,) = mirror_table.roots_from_damping((100.0,), (1.0,))
    assert real == -2 * np.pi * 100.0
    for zeta in (0.03, 0.9, -0.2):
        w = 2 * np.pi * 300.0
        pair = mirror_table.roots_from_damping((300.0,), (zeta,))
        np.testing.assert_allclose(pair, [-zeta * w + 1j * w * np.sqrt(1 - zeta**2), np.conj(pair[0])], rtol=1e-14)
    assert mirror_table.roots_from_damping((100.0,), (-1.0,)) == (2 * np.pi * 100.0,)


@pytest.mark.promise("mirror-file-10")
def test_a_linear_part_that_falls_where_it_is_normalised_is_turned(tmp_path):
    """Coefficients of either sign give the same mirror; above its resonance it is turned."""
    rising = built(OF_ONE_AXIS[2], tmp_path)
    falling = built(OF_ONE_AXIS[2].replace("[1.0, 40.0, 4.0e6]", "[-1.0, -40.0, -4.0e6]"), tmp_path)
    freq = [1.0, 50.0, 400.0]
    at = rising.frequency_response(freq)[:, 0, 0]
    np.testing.assert_allclose(falling.frequency_response(freq)[:, 0, 0], at, rtol=1e-12)
    assert abs(at[0]) == pytest.approx(2e-3, rel=1e-12) and at[0].real > 0.0
    beyond = OF_ONE_AXIS[0].replace('normalise_at = "1 Hz" ', 'normalise_at = "1.5 kHz" ')
    (there,) = built(beyond, tmp_path).frequency_response([1500.0])[:, 0, 0]
    assert abs(there) == pytest.approx(250e-6, rel=1e-12) and there.real > 0.0
    assert built(beyond, tmp_path).frequency_response([1.0])[0, 0, 0].real < 0.0


@pytest.mark.promise("mirror-file-15")
def test_poles_that_coincide_make_no_mirror_and_unstable_ones_no_loop(tmp_path):
    alike = OF_ONE_AXIS[0].replace('["800 Hz", "4 kHz"]', '["800 Hz", "800 Hz"]').replace("[0.03, 1.0]", "[0.03, 0.03]")
    with pytest.raises(ValueError, match="two poles coincide: the transfer function has no modal form"):
        built(alike, tmp_path)
    growing = built(OF_ONE_AXIS[2].replace("[1.0, 900.0,", "[1.0, -900.0,"), tmp_path)
    assert np.linalg.eigvals(growing.A).real.max() > 0.0
    pid = control.pid(control.Gains(10.0, 1e3, 0.0, 1e-4), 1e-4)
    drive = control.Drive(-np.inf, np.inf, np.inf, np.inf, 0.0, 0.0)
    plant = control.sampled_plant(growing, drive, control.Timing(1e-4, 1, 0))
    with pytest.raises(ValueError, match="the closed loop is unstable: a pole at"):
        control.margins(pid, plant, 1e-4)


@pytest.mark.promise("mirror-file-19")
def test_one_threshold_of_0_is_a_straight_gain(tmp_path):
    drive = np.array([0.0, 3.0, -1.0, 2.0])
    (play,) = built(OF_ONE_AXIS[2], tmp_path).plays
    np.testing.assert_allclose(play.response(drive, 1e-3), 2e-3 * drive, rtol=1e-14)
    assert hysteresis.slow_gain(built(OF_ONE_AXIS[0], tmp_path).plays[0]) == pytest.approx(250e-6, rel=1e-14)


@pytest.mark.promise("mirror-file-25", "mirror-file-26")
def test_the_further_examples_are_what_the_page_calls_them(tmp_path):
    static, coil = (load_text(text, tmp_path) for text in OF_ONE_AXIS[1:])
    assert static.bouc_wen is not None and static.creep is not None and static.linear is None
    assert coil.bouc_wen is None and coil.prandtl_ishlinskii.thresholds_v == (0.0,)
    zeros, poles = coil.linear.roots
    assert len(zeros) == 2 and abs(zeros[0].imag) > 10 * abs(zeros[0].real) and max(p.real for p in poles) < 0.0
    assert len(coil.uncertainty.parameters) == 2 and coil.uncertainty.standard_errors == (0.02, 0.05)


def load_text(text, tmp_path):
    path = tmp_path / "mirror.toml"
    path.write_text(text, encoding="utf-8")
    return load_mirror(path).mirror


@pytest.mark.promise("mirror-file-55")
def test_import_of_the_page_is_a_call_that_there_is():
    from microrad.export import linear_import

    made = python("import_mat").split("text = ")[0]
    found: dict = {}
    exec(made, found)  # the page's own lines
    assert isinstance(found["given"], linear_import.Given) and found["import_mat"] is linear_import.import_mat
