"""Campaign files: what they hold once read, every way in which one is refused, and the missions of their rows."""

import json
import math
import pickle
import re
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from campaign_files import HEAD, IDENTIFIED, LOOP, NOISE, POWER, UNCERTAINTY, loaded, written
from made_tables import one_line
from microrad import link
from microrad.campaign import bundle
from microrad.campaign import file as campaign_file
from microrad.campaign.definition import cells, draws, keys, reader
from microrad.campaign.definition.distributions import OneOf, uncovered
from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.definition.reader import block_rows, read_definition
from microrad.campaign.definition.records import Variable
from microrad.campaign.file import load_campaign
from microrad.campaign.ledger import file
from microrad.campaign.records import CampaignError
from microrad.campaign.rows import evaluate, loops, sampling
from microrad.campaign.rows.evaluator import Evaluator
from microrad.campaign.rows.missions import MissionBuilder
from microrad.core import reads
from microrad.loop.pointing_loop.ensemble import Span
from microrad.mission.file import MissionError, load_mission, named_files, open_mission
from scenes import scene_of
from shipped import SHIPPED

QUAD_CELL = (
    'noise = "1 urad"                      # assumption: rms per axis',
    'quad_cell = { responsivity = "1 A/W", background_power = "0 pW", dark_current = "1 nA", '
    'thermal_noise = "0.05 pA/sqrt(Hz)", received_power = "100 pW", spot = "airy" } # rms per axis',
)

JITTER = '[jitter]\nbias = ["0 urad", "0 urad"]\nrms = ["3 urad", "3 urad"]\nbandwidth = "50 Hz"\n'


def faults(folder, text, **how):
    with pytest.raises(MissionError) as caught:
        loaded(folder, text, **how)
    return caught.value.faults


def line_of(folder, piece):
    text = (folder / "campaign.toml").read_text(encoding="utf-8")
    return next(i for i, line in enumerate(text.splitlines(), 1) if piece in line)


# ------------------------------------------------------------------------------------------------------------- reading
@pytest.mark.promise("campaigns-7")
def test_a_campaign_with_everything_in_it(tmp_path):
    text = f"""{HEAD.replace("256", "300")}realisations = 32
row_limit = "60 s"
worst = 5
keep = ["residual_rms", "margin"]
{LOOP}
[set]
"fine_pointing.strain_gauge.noise" = "0.2 urad"   # measured: on the bench
{POWER}{NOISE}{IDENTIFIED}
[grid]
"terminals.geo_aperture" = ["15 cm", "20 cm"]
mirror = ["mirror.toml"]
[limits.margin]
least = "2 dB"
[precision]
output = "margin"
quantile = 0.003
half_width = "0.05 dB"
confidence = 0.99
at_most = 1000
[optimise]
minimise = "-margin"
confidence = 0.99
rows = 64
evaluations = 50
[optimise.variables."terminals.leo_aperture"]
low = "3 cm"
high = "12 cm"
"""
    c = loaded(tmp_path, text)
    assert (c.rows, c.most_rows, c.block, c.realisations, c.loop_varies) == (320, 1024, 32, 32, True)
    assert (c.table.row_limit_s, c.table.worst, c.keep) == (60.0, 5, ("residual_rms", "margin"))
    assert c.half_width == 0.05
    assert [(each.output, each.least, each.most) for each in c.limits] == [("margin", 2.0, None)]
    sizes = ("15 cm", "20 cm")
    assert [each.values for each in c.cells] == [
        {"terminals.geo_aperture": size, "mirror": "mirror.toml"} for size in sizes
    ]
    assert [b.file.mission.terminals.geo_aperture_m for b in c.cells] == [0.15, 0.2]
    assert tuple((each.key, each.unit) for each in c.inputs) == (
        ("communication.transmit_power", "W"),
        ("fine_pointing.optical_sensor.noise", "rad"),
        ("mirror.bouc_wen.d1", "rad/V"),
        ("mirror.bouc_wen.alpha", "1/V"),
        ("mirror.linear.poles.1", "Hz"),
    )
    assert [each.distribution for each in c.inputs][:3] == [
        "normal, mean 5 W, deviation 200 mW",
        "log-uniform, 500 nrad to 2 µrad",
        "identified, standard error 2 %",
    ]
    assert c.variables == (Variable("terminals.leo_aperture", "m", 0.03, 0.12),)
    assert c.fixed == {"fine_pointing.strain_gauge.noise": "0.2 urad"}
    gauge = c.mission.sources["fine_pointing.strain_gauge.noise"]
    assert (gauge.value, gauge.comment, gauge.file) == ("0.2 urad", "campaign: measured: on the bench", "campaign file")
    assert gauge.line == line_of(tmp_path, "strain_gauge")
    gridded = c.cells[1].file.sources["terminals.geo_aperture"]
    assert (gridded.value, gridded.comment, gridded.line) == ("20 cm", "campaign: [grid]", line_of(tmp_path, "geo_"))
    assert [path.name for path in c.files] == ["campaign.toml", "mission.toml", "mirror.toml"]
    assert len(c.warnings) == 2
    assert "300 is rounded up to 320" in c.warnings[0]
    assert "takes as long as 64" in c.warnings[1]


@pytest.mark.promise("campaigns-7", "campaigns-16", "campaigns-17", "campaigns-18")
def test_a_loop_may_begin_without_settling(tmp_path):
    """Its duration is no longer than what the mission settles for."""
    campaign = loaded(tmp_path, HEAD + LOOP.replace('"1 s"', '"0.5 s"') + 'settle = "0 s"\n')
    assert (campaign.table.loop.settle_s, campaign.table.loop.duration_s) == (0.0, 0.5)


def test_what_is_left_out_has_its_default(tmp_path):
    c = loaded(tmp_path, HEAD + POWER)
    assert (c.rows, c.most_rows, c.block, c.realisations, c.loop_varies) == (256, 256, 32, 1, False)
    assert (c.table.row_limit_s, c.table.worst, c.table.loop) == (300.0, 3, None)
    assert c.keep == ("margin", "outage", "short", "data_rate", "beacon_margin", "answer_margin")
    assert [(each.output, each.least, each.source) for each in c.limits] == [("margin", 3.0, "requirement.margin")]
    assert ([cell.values for cell in c.cells], c.warnings, c.fixed, np.isnan(c.half_width)) == ([{}], (), {}, True)
    with_loop = loaded(tmp_path, HEAD + LOOP + POWER)
    assert "residual_rms" in with_loop.keep
    assert "volume" not in with_loop.keep
    assert [(each.output, each.most) for each in with_loop.limits][1] == ("residual_quantile", 1e-5)
    own, f = with_loop.table.loop, with_loop.mission.mission.fine_pointing
    assert (own.axes, own.mirror, loops.span(own, f, 1)) == ("both", "given", Span(1.0, f.settle_s, 1))
    bare = own.model_copy(update={"duration_s": None, "settle_s": 0.1})
    assert loops.span(bare, f, 2) == Span(f.duration_s, 0.1, 2) and f.duration_s != 1.0
    listed = loaded(
        tmp_path, HEAD + distributed("terminals.leo_aperture", 'distribution = "table"\nvalues = ["4 cm", "5 cm"]')
    )
    assert listed.draws[0].distribution.probabilities == (0.5, 0.5)


@pytest.mark.promise("campaigns-19")
@pytest.mark.parametrize(
    ("inputs", "varies", "realisations"), [(POWER, False, 1), (NOISE, True, 64), (IDENTIFIED, True, 64)]
)
def test_realisations_follow_from_whether_rows_share_their_loop(tmp_path, inputs, varies, realisations):
    c = loaded(tmp_path, f'{HEAD}{LOOP}{inputs}[set]\nmirror = "mirror.toml"\n')
    assert (c.loop_varies, c.realisations) == (varies, realisations)


@pytest.mark.promise("campaigns-19")
@pytest.mark.parametrize(("realisations", "told"), [(63, 64), (64, 0), (65, 128), (128, 0)])
def test_realisations_that_fill_their_batches_are_not_warned_of(tmp_path, realisations, told):
    c = loaded(tmp_path, f"{HEAD}realisations = {realisations}\n{LOOP}{NOISE}")
    assert [f"takes as long as {told}:" in warning for warning in c.warnings] == [True] * bool(told)


@pytest.mark.promise("campaigns-7")
def test_an_item_may_vary_in_a_list_of_set(tmp_path):
    lists = (
        '[set]\n"scenario.pid_frequencies" = ["2 Hz", "9 Hz"]\n[grid]\n"scenario.pid_frequencies.1" = ["3 Hz", "4 Hz"]'
    )
    cells = loaded(tmp_path, HEAD + POWER + lists).cells
    assert [each.file.mission.scenario.pid_frequencies_hz for each in cells] == [(3.0, 9.0), (4.0, 9.0)]


@pytest.mark.promise("campaigns-20")
def test_random_rows_are_not_rounded(tmp_path):
    c = loaded(tmp_path, HEAD.replace("sobol", "random").replace("256", "301") + POWER)
    assert (c.rows, c.warnings) == (301, ())


def test_keys_may_be_quoted_or_tables_inside_tables(tmp_path):
    quoted = loaded(tmp_path, f'{HEAD}{POWER}[set]\n"terminals.leo_aperture" = "6 cm"\n')
    plain = POWER.replace('"communication.transmit_power"', "communication.transmit_power")
    nested = loaded(tmp_path, f'{HEAD}{plain}[set.terminals]\nleo_aperture = "6 cm"\n')
    assert nested.draws == quoted.draws
    assert nested.mission.mission == quoted.mission.mission
    assert nested.mission.mission.terminals.leo_aperture_m == 0.06


def test_a_mirror_of_set_takes_the_place_of_the_missions(tmp_path):
    c = loaded(tmp_path, f'{HEAD}{POWER}[set]\nmirror = "plain.toml"\n"mirror.travel" = "3 mrad"\n')
    assert c.mission.mission.mirror.name == "plain mirror of a test"
    assert c.mission.mission.mirror.travel_rad == 3e-3
    assert (tmp_path / "plain.toml") in c.files
    assert c.mission.mirror_file.path == tmp_path / "plain.toml"


def test_a_grid_may_give_what_the_mission_leaves_open(tmp_path):
    """The mission under [set] alone is none; every cell is."""
    unknown = (('leo_aperture = "5 cm"', 'leo_aperture = "unknown"'),)
    text = HEAD + POWER + '[grid]\n"terminals.leo_aperture" = ["6 cm", "7 cm"]\n'
    c = loaded(tmp_path, text, changes=unknown)
    assert [b.file.mission.terminals.leo_aperture_m for b in c.cells] == [0.06, 0.07]
    assert c.mission.mission.terminals.leo_aperture_m == 0.06
    assert "in no source" in faults(tmp_path, HEAD, changes=unknown)[0].reason


@pytest.mark.promise("campaigns-7")
def test_words_lists_and_switches_in_set_and_grid(tmp_path):
    text = f"""{HEAD}{POWER}
[set]
"conventions.residual" = "radial"
"point_ahead.corrected" = false
"scenario.pid_frequencies" = ["2 Hz", "20 Hz"]
[grid]
"conventions.strehl" = ["decibel", "ratio"]
"fine_pointing.geometry.coupling" = [[1.0, 0.0, 0.0, 1.0], [1.0, 0.1, 0.0, 1.0]]
"""
    c = loaded(tmp_path, text)
    assert len(c.cells) == 4
    assert c.cells[1].values == {
        "conventions.strehl": "decibel",
        "fine_pointing.geometry.coupling": "[1.0, 0.1, 0.0, 1.0]",
    }
    m = c.cells[3].file.mission
    assert (m.conventions.residual, m.point_ahead.corrected, m.conventions.strehl) == ("radial", False, "ratio")
    assert m.scenario.pid_frequencies_hz == (2.0, 20.0)
    assert m.fine_pointing.geometry.coupling == (1.0, 0.1, 0.0, 1.0)


def test_files_that_a_mission_names_belong_to_the_campaign(tmp_path):
    text = (
        HEAD + POWER + '[set]\n"fine_pointing.vibration.spectrum" = "table"\n"fine_pointing.vibration.file" = "a.csv"\n'
    )
    assert "does not exist" in faults(tmp_path, text)[0].reason
    (tmp_path / "a.csv").write_text("Hz, urad^2/Hz\n1, 1\n2, 1\n")
    c = loaded(tmp_path, text)
    assert c.files[-1] == tmp_path / "a.csv"
    assert named_files(c.mission.mission) == ("a.csv",)
    of = c.mission.mission.model_copy(update={"constellation": SimpleNamespace(file="shell.tle")})
    assert named_files(of) == ("shell.tle", "a.csv")
    text = text.replace('"a.csv"\n', '"a.csv"\n[inputs."fine_pointing.vibration.file"]\n') + (
        'distribution = "table"\nvalues = ["a.csv", "b.csv"]\n'
    )
    text = text.replace('"fine_pointing.vibration.file" = "a.csv"\n', "")
    (tmp_path / "b.csv").write_text("Hz, urad^2/Hz\n1, 2\n2, 1\n")
    text = text.replace(
        '"fine_pointing.vibration.spectrum" = "table"', '"fine_pointing.vibration.spectrum" = "olympus"'
    )
    assert "does not belong to spectrum" in faults(tmp_path, text)[0].reason


# ------------------------------------------------------------------------------------------------------------ refusals
def distributed(key, body):
    return f'[inputs."{key}"]\n{body}\n'


TABLE = 'distribution = "table"\n'
REFUSED = {
    "a misspelled key of the file": ("sampling =", "samplng =", "samplng", "is no key of"),
    "a kind of sampling": ('"sobol"', '"sobols"', "sampling", "is none of the choices"),
    "no rows": ("runs = 256", "runs = 0", "runs", "is below 1"),
    "a seed below 0": ("seed = 1", "seed = -1", "seed", "is below 0"),
    "a seed too large": ("seed = 1", f"seed = {2**64}", "seed", "is above"),
    "a unit": ('mean = "5 W"', 'mean = "5 m"', "inputs.communication.transmit_power.mean", "another kind"),
    "no unit": ('mean = "5 W"', "mean = 5.0", "inputs.communication.transmit_power.mean", "without a unit"),
    "a bound": ('mean = "5 W"', 'mean = "-5 W"', "inputs.communication.transmit_power.mean", "is not above 0 W"),
    "no deviation": ('deviation = "0.2 W"', "", "inputs.communication.transmit_power.deviation", "is missing"),
    "a deviation of 0": ('"0.2 W"', '"0 W"', "inputs.communication.transmit_power.deviation", "is not above 0 W"),
    "a kind of distribution": ('"normal"', '"norml"', "inputs.communication.transmit_power.distribution", "is none"),
    "a key of a distribution": ("mean =", "means =", "inputs.communication.transmit_power.means", "is no key"),
    "an unknown key": ("transmit_power", "transmitpower", "inputs.communication.transmitpower", "is no key"),
    "a table as key": ("communication.transmit_power", "communication", "inputs.communication", "is a table"),
    "a key behind a value": ("transmit_power", "transmit_power.x", "inputs.communication.transmit_power.x", "goes on"),
}
THOUSAND = ".a" * 999
ADDED = {
    "a key in set and inputs": (
        '[set]\n"communication.transmit_power" = "4 W"',
        "inputs.communication.transmit_power",
        "stands in [set] too",
    ),
    "a key in grid and inputs": (
        '[grid]\n"communication.transmit_power" = ["4 W"]',
        "inputs.communication.transmit_power",
        "stands in [grid] too",
    ),
    "a mirror in set and grid": (
        '[set]\nmirror = "mirror.toml"\n[grid]\nmirror = ["mirror.toml", "plain.toml"]',
        "grid.mirror",
        "stands in [set] too",
    ),
    "an item of a list of a grid in set": (
        '[set]\n"scenario.pid_frequencies.1" = "2 Hz"\n[grid]\n"scenario.pid_frequencies" = [["2 Hz"], ["3 Hz"]]',
        "set.scenario.pid_frequencies.1",
        "is an item of scenario.pid_frequencies, which stands in [grid] as a whole",
    ),
    "a list and its item in set": (
        '[set]\n"scenario.pid_frequencies" = ["2 Hz"]\n"scenario.pid_frequencies.1" = "3 Hz"',
        "set.scenario.pid_frequencies.1",
        "is an item of scenario.pid_frequencies, which stands in [set] as a whole",
    ),
    "a value of set": ('[set]\n"terminals.leo_aperture" = "5 kg"', "set.terminals.leo_aperture", "another kind"),
    "a word of set": ('[set]\n"conventions.strehl" = "ratios"', "set.conventions.strehl", "is none of the choices"),
    "a mirror that is no path": ("[set]\nmirror = 1", "set.mirror", "is no path"),
    "a value that does not fit others": (
        '[set]\n"fine_pointing.reference.point_ahead" = "0 urad"',
        "set.fine_pointing.reference.point_ahead",
        "is not 2 v / c",
    ),
    "an empty grid": ('[grid]\n"terminals.leo_aperture" = []', "grid.terminals.leo_aperture", "something in it"),
    "no list in a grid": ('[grid]\n"terminals.leo_aperture" = "5 cm"', "grid.terminals.leo_aperture", "is not a list"),
    "a value of a grid": ('[grid]\n"terminals.leo_aperture" = ["5"]', "grid.terminals.leo_aperture", "without a unit"),
    "a grid with a value twice": (
        '[grid]\n"terminals.leo_aperture" = ["5 cm", "6 cm", "5 cm"]',
        "grid.terminals.leo_aperture",
        "stands twice",
    ),
    "a cell that is no mission": (
        '[grid]\n"beacon.divergence" = ["780 urad", "1 urad"]',
        "grid.beacon.divergence",
        "is below diffraction",
    ),
    "a grid too large": (
        f'[grid]\n"terminals.leo_aperture" = {[f"{i} mm" for i in range(50, 150)]}\n'
        f'"terminals.geo_aperture" = {[f"{i} mm" for i in range(50, 150)]}'.replace("'", '"'),
        "grid",
        "has 10000 cells",
    ),
    "a mirror without uncertainty": (IDENTIFIED, "inputs.mirror", "has no table uncertainty"),
    "a grid of mirrors, one without": (
        f'{IDENTIFIED}[grid]\nmirror = ["mirror.toml", "plain.toml"]',
        "inputs.mirror",
        'the mirror "plain mirror of a test" has no table uncertainty',
    ),
    "a parameter of an identified mirror drawn by itself": (
        IDENTIFIED
        + distributed("mirror.bouc_wen.d1", 'distribution = "uniform"\nlow = "1 urad/V"\nhigh = "2 urad/V"')
        + '[set]\nmirror = "mirror.toml"',
        "inputs.mirror",
        "draws mirror.bouc_wen.d1, which the campaign gives too",
    ),
    "a mirror that is not identified": (
        '[inputs.mirror]\ndistribution = "normal"\nmean = 1\ndeviation = 1',
        "inputs.mirror",
        "does not go together",
    ),
    "identified, and no mirror": (
        distributed("terminals.leo_aperture", 'distribution = "identified"'),
        "inputs.terminals.leo_aperture",
        "does not go together",
    ),
    "an input that is no table": ("inputs.name = 1", "inputs.name", "is no table"),
    "a range that goes down": (
        distributed("terminals.leo_aperture", 'distribution = "uniform"\nlow = "6 cm"\nhigh = "5 cm"'),
        "inputs.terminals.leo_aperture.high",
        'is not above low ("6 cm")',
    ),
    "a logarithm of 0": (
        distributed("beacon.receive_optics_loss", 'distribution = "log-uniform"\nlow = "0 dB"\nhigh = "1 dB"'),
        "inputs.beacon.receive_optics_loss.low",
        "has no logarithm",
    ),
    "a word drawn from a range": (
        distributed("conventions.strehl", 'distribution = "uniform"\nlow = 1\nhigh = 2'),
        "inputs.conventions.strehl",
        "is not a quantity that takes any value",
    ),
    "a list drawn from a range": (
        distributed("jitter.rms", 'distribution = "uniform"\nlow = "1 urad"\nhigh = "2 urad"'),
        "inputs.jitter.rms",
        "is a list, whose items are drawn each by its own key",
    ),
    "an input without a distribution": (
        distributed("terminals.leo_aperture", 'low = "5 cm"\nhigh = "6 cm"'),
        "inputs.terminals.leo_aperture.distribution",
        "is missing",
    ),
    "a distribution that is a number": (
        distributed("terminals.leo_aperture", 'distribution = 1\nlow = "5 cm"\nhigh = "6 cm"'),
        "inputs.terminals.leo_aperture.distribution",
        "is none of the choices",
    ),
    "a distribution that is a list": (
        distributed("terminals.leo_aperture", 'distribution = ["uniform"]\nlow = "5 cm"\nhigh = "6 cm"'),
        "inputs.terminals.leo_aperture.distribution",
        "is none of the choices",
    ),
    "a table of one value without its list": (
        distributed("terminals.leo_aperture", TABLE + 'values = "5 cm"'),
        "inputs.terminals.leo_aperture.values",
        "is not a list with something in it",
    ),
    "a table without values": (
        distributed("terminals.leo_aperture", TABLE + "values = []"),
        "inputs.terminals.leo_aperture.values",
        "is not a list with something in it",
    ),
    "a value of a table": (
        distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "0 cm"]'),
        "inputs.terminals.leo_aperture.values",
        "is not above 0 m",
    ),
    "a table with a value twice": (
        distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "50 mm"]'),
        "inputs.terminals.leo_aperture.values",
        "has a value twice",
    ),
    "too few weights": (
        distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "6 cm"]\nweights = [1]'),
        "inputs.terminals.leo_aperture.weights",
        "each value its weight",
    ),
    "weights without their list": (
        distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "6 cm"]\nweights = 1'),
        "inputs.terminals.leo_aperture.weights",
        "each value its weight",
    ),
    "a weight in words": (
        distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "6 cm"]\nweights = [1, "2"]'),
        "inputs.terminals.leo_aperture.weights",
        "each value its weight",
    ),
    "a weight of 0": (
        distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "6 cm"]\nweights = [1, 0]'),
        "inputs.terminals.leo_aperture.weights",
        "each value its weight",
    ),
    "a weight that is true": (
        distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "6 cm"]\nweights = [1, true]'),
        "inputs.terminals.leo_aperture.weights",
        "each value its weight",
    ),
    "a weight without end": (
        distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "6 cm"]\nweights = [1, inf]'),
        "inputs.terminals.leo_aperture.weights",
        "each value its weight",
    ),
    "a weight that is none": (
        distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "6 cm"]\nweights = [nan, 1]'),
        "inputs.terminals.leo_aperture.weights",
        "each value its weight",
    ),
    "a group of named tables": (
        distributed("pointing.lines", 'distribution = "uniform"\nlow = 1\nhigh = 2'),
        "inputs.pointing.lines",
        "is a group of named tables and no value",
    ),
    "a named table": (
        distributed("pointing.lines.body_pointing", 'distribution = "uniform"\nlow = 1\nhigh = 2'),
        "inputs.pointing.lines.body_pointing",
        "is a table and no value",
    ),
    "a named table that is not there": (
        distributed("pointing.lines.body_pointings.error", 'distribution = "uniform"\nlow = 1\nhigh = 2'),
        "inputs.pointing.lines.body_pointings.error",
        "is no key of [pointing.lines]",
    ),
    "a list of no other end": (
        distributed("scenario.pid_frequencies.0", 'distribution = "uniform"\nlow = "1 Hz"\nhigh = "2 Hz"'),
        "inputs.scenario.pid_frequencies.0",
        "is no item of scenario.pid_frequencies",
    ),
    "a precision that is no table": ("precision = 0.05", "precision", "is of the wrong kind"),
    "a set that is no table": ("set = 1", "set", "is no table"),
    "a grid that is no table": ('grid = ["5 cm"]', "grid", "is no table"),
    "limits that are no table": ('limits = "3 dB"', "limits", "is no table"),
    "a mirror of no name in set": ('[set]\nmirror = ""', "set.mirror", "is no path"),
    "a mirror of no name in a grid": ('[grid]\nmirror = ["mirror.toml", ""]', "grid.mirror", "is no path"),
    "equal limits": ('[limits.margin]\nleast = "3 dB"\nmost = "3 dB"', "limits.margin.most", "not above"),
    "drawn too narrow": (
        '[inputs."communication.transmit_power".drawn_as]\ndistribution = "normal"\nmean = "4 W"\ndeviation = "0.1 W"',
        "inputs.communication.transmit_power.drawn_as",
        "is too narrow",
    ),
    "drawn from a range": (
        '[inputs."communication.transmit_power".drawn_as]\ndistribution = "uniform"\nlow = "4 W"\nhigh = "6 W"',
        "inputs.communication.transmit_power.drawn_as",
        "never draws far out",
    ),
    "drawn as identified": (
        '[inputs."communication.transmit_power".drawn_as]\ndistribution = "identified"',
        "inputs.communication.transmit_power.drawn_as",
        "is no distribution that an input can be drawn as",
    ),
    "drawn as what is drawn as something else": (
        '[inputs."communication.transmit_power".drawn_as]\ndistribution = "normal"\nmean = "5 W"\n'
        'deviation = "0.3 W"\n[inputs."communication.transmit_power".drawn_as.drawn_as]\ndistribution = "normal"\n'
        'mean = "5 W"\ndeviation = "0.4 W"',
        "inputs.communication.transmit_power.drawn_as",
        "is no distribution that an input can be drawn as",
    ),
    "no list of outputs": ("keep = []", "keep", "is not a list with something in it"),
    "an output without its list": ('keep = "margin"', "keep", "is not a list with something in it"),
    "an unknown output": ('keep = ["margn"]', "keep", "is no output"),
    "an output of the loop without a loop": ('keep = ["residual_rms"]', "keep", "needs the fine-pointing loop"),
    "an unknown limit": ('[limits.margn]\nleast = "3 dB"', "limits.margn", "is no output"),
    "a limit of what is not kept": ('[limits.volume]\nleast = "3 GB"', "limits.volume", "is not kept"),
    "a limit without a value": ("[limits.margin]", "limits.margin", "has neither least nor most"),
    "a limit that is no table": ('[limits]\nmargin = "3 dB"', "limits.margin", "has neither least nor most"),
    "a limit in another unit": ('[limits.margin]\nleast = "3 W"', "limits.margin.least", "another kind"),
    "limits the wrong way round": ('[limits.margin]\nleast = "3 dB"\nmost = "2 dB"', "limits.margin.most", "not above"),
    "a default limit that varies": (
        distributed("requirement.margin", 'distribution = "uniform"\nlow = "1 dB"\nhigh = "2 dB"'),
        "inputs.requirement.margin",
        "is the limit of margin as well",
    ),
    "a loop that no controller closes": (
        LOOP.replace('"PI"', '"LQR"'),
        "loop.controller",
        "is no controller",
    ),
    "a loop that only settles": (LOOP.replace('"1 s"', '"0.5 s"'), "loop.duration", "all of it settling"),
    "a comparison model that is missing": (
        f'{LOOP}mirror = "comparison"\n[set]\nmirror = "plain.toml"',
        "loop.mirror",
        "needs a comparison model",
    ),
    "a tail without a loop": ('[tail]\nerror = "12 urad"\nprobability = 1e-6', "tail", "needs the fine-pointing loop"),
    "a tail with drawn inputs of the loop": (
        f'{LOOP}{NOISE}[tail]\nerror = "12 urad"\nprobability = 1e-6',
        "inputs.fine_pointing.optical_sensor.noise",
        "changes the loop",
    ),
    "a tail with outputs": (
        f'keep = ["margin"]\n{LOOP}[tail]\nerror = "12 urad"\nprobability = 1e-6',
        "keep",
        "stands beside [tail]",
    ),
    "an optimisation of nothing": (
        '[optimise]\nminimise = "margin"\nconfidence = 0.99\nrows = 64\nevaluations = 10\n[optimise.variables]',
        "optimise.variables",
        "holds no variable",
    ),
    "an optimisation of something else": (
        '[optimise]\nminimise = "-margn"\nconfidence = 0.99\nrows = 64\nevaluations = 10\n'
        '[optimise.variables."terminals.leo_aperture"]\nlow = "3 cm"\nhigh = "6 cm"',
        "optimise.minimise",
        "is neither a variable of the optimisation nor an output",
    ),
    "a variable that is no quantity": (
        '[optimise]\nminimise = "margin"\nconfidence = 0.99\nrows = 64\nevaluations = 10\n'
        '[optimise.variables."conventions.strehl"]\nlow = 1\nhigh = 2',
        "optimise.variables.conventions.strehl",
        "is not a quantity",
    ),
    "a precision of what is not kept": (
        '[precision]\noutput = "volume"\nquantile = 0.1\nhalf_width = "1 GB"\nconfidence = 0.9\nat_most = 1000',
        "precision.output",
        "is not kept",
    ),
    "a precision of the radius without a loop": (
        '[precision]\noutput = "radius"\nquantile = 0.9\nhalf_width = "1 urad"\nconfidence = 0.9\nat_most = 1000',
        "precision.output",
        "needs the fine-pointing loop",
    ),
    "a precision in another unit": (
        '[precision]\noutput = "margin"\nquantile = 0.1\nhalf_width = "1 GB"\nconfidence = 0.9\nat_most = 1000',
        "precision.half_width",
        "another kind",
    ),
    "a precision that ends before its first round": (
        '[precision]\noutput = "margin"\nquantile = 0.1\nhalf_width = "1 dB"\nconfidence = 0.9\nat_most = 100',
        "precision.at_most",
        "is below the 256 rows",
    ),
    "a precision of what is no output": (
        '[precision]\noutput = "radios"\nquantile = 0.9\nhalf_width = "1 urad"\nconfidence = 0.9\nat_most = 1000',
        "precision.output",
        "is no output",
    ),
    "distributions beyond both bounds of a key": (
        distributed("requirement.outage", 'distribution = "normal"\nmean = 0.5\ndeviation = 2.0'),
        "inputs.requirement.outage",
        "has 80.3 % of its draws not above 0 or not below 1",
    ),
    "drawn beyond the bounds of a key": (
        '[inputs."communication.transmit_power".drawn_as]\ndistribution = "uniform"\nlow = "-1 W"\nhigh = "9 W"',
        "inputs.communication.transmit_power.drawn_as.low",
        "is not above 0 W",
    ),
    "distributions about no mission": (
        distributed("beacon.divergence", 'distribution = "normal"\nmean = "2 urad"\ndeviation = "0.1 urad"'),
        "inputs.beacon.divergence",
        "leaves no mission in the middle of all distributions: ",
    ),
}


def placed(text, added):
    """A piece of a campaign file where TOML takes it: keys of the root before the first table."""
    root, tables = ("", added) if added.startswith("[") else (added.partition("\n[")[0], added.partition("\n[")[2])
    head, _, rest = text.partition("[inputs")
    tables = tables if tables.startswith("[") or not tables else f"[{tables}"
    return f"{head}{root}\n[inputs{rest}{tables}\n"


def test_a_plain_number_that_would_do_is_shown_without_quotes_and_a_quantity_with_them(tmp_path):
    for key, low, shown in (("communication.strehl", '"x"', "low = 1.0"), ("beacon.strehl", "-1", "low = 5.0")):
        body = f'distribution = "uniform"\nlow = {low}\nhigh = 0.5'
        (fault,) = faults(tmp_path, HEAD + distributed(key, body))
        assert fault.key == f"inputs.{key}.low"
        assert fault.expected.endswith(f"; for example {shown}")
    (fault,) = faults(tmp_path, HEAD + POWER.replace('"5 W"', "5.0"))
    assert fault.expected.endswith('; for example mean = "5 W"')


@pytest.mark.parametrize(
    ("mission", "reason"), [('""', "is empty"), ("1", "is of the wrong kind"), (None, "is missing")]
)
def test_a_campaign_without_the_name_of_its_mission_is_refused_in_one_fault(tmp_path, mission, reason):
    line = "" if mission is None else f"mission = {mission}\n"
    (fault,) = faults(tmp_path, HEAD.replace('mission = "mission.toml"\n', line) + POWER)
    assert fault.key == "mission"
    assert reason in fault.reason


def test_variables_that_are_no_table_are_refused(tmp_path):
    text = '[optimise]\nminimise = "margin"\nconfidence = 0.99\nrows = 64\nevaluations = 10\nvariables = 1\n'
    assert [fault.key for fault in faults(tmp_path, HEAD + POWER + text)] == ["optimise.variables"]


def test_draws_of_which_exactly_half_are_none_are_taken_with_a_warning(tmp_path):
    loss = distributed(
        "communication.implementation_loss", 'distribution = "normal"\nmean = "0 dB"\ndeviation = "1 dB"'
    )
    (warning,) = loaded(tmp_path, HEAD + loss).warnings
    assert warning.startswith("50 % of the draws of communication.implementation_loss are below 0 dB: those rows")


def test_a_grid_and_a_table_may_have_as_much_as_their_limits_say(tmp_path, monkeypatch):
    sizes = '"5 cm", "6 cm"'
    grid = f'{HEAD}{POWER}[grid]\n"terminals.leo_aperture" = [{sizes}]\n'
    table = HEAD + distributed("terminals.leo_aperture", f"{TABLE}values = [{sizes}]")
    monkeypatch.setattr(cells, "MOST_CELLS", 2)
    monkeypatch.setattr(draws, "MOST_ITEMS", 2)
    assert len(loaded(tmp_path, grid).cells) == 2
    assert loaded(tmp_path, table).draws[0].distribution.values == (0.05, 0.06)
    assert [fault.key for fault in faults(tmp_path, table.replace(sizes, f'{sizes}, "7 cm"'))] == [
        "inputs.terminals.leo_aperture.values"
    ]
    monkeypatch.setattr(cells, "MOST_CELLS", 1)
    (fault,) = faults(tmp_path, grid)
    assert (fault.key, fault.reason, fault.expected) == ("grid", "has 2 cells", "at most 1")
    one = HEAD + POWER + distributed("terminals.leo_aperture", f'{TABLE}values = ["5 cm"]')
    assert loaded(tmp_path, one).draws[1].distribution.probabilities == (1.0,)


def test_a_precision_may_end_with_its_first_round(tmp_path):
    wanted = '[precision]\noutput = "margin"\nquantile = 0.1\nhalf_width = "1 dB"\nconfidence = 0.9\nat_most = 256\n'
    assert loaded(tmp_path, HEAD + POWER + wanted).most_rows == 256


@pytest.mark.promise("campaigns-8")
@pytest.mark.parametrize("what", REFUSED)
def test_a_wrong_value_is_refused_with_its_key_and_line(tmp_path, what):
    old, new, key, reason = REFUSED[what]
    text = HEAD + POWER
    assert old in text
    found = faults(tmp_path, text.replace(old, new, 1))
    assert [(fault.key, reason in fault.reason) for fault in found] == [(key, True)], found
    assert 1 <= found[0].line <= 9
    assert found[0].file.endswith("campaign.toml")
    assert load_campaign(written(tmp_path, text)).rows == 256  # and without it nothing is refused


@pytest.mark.promise("campaigns-7")
@pytest.mark.parametrize("what", ADDED)
def test_what_does_not_fit_is_refused_with_its_key(tmp_path, what):
    added, key, reason = ADDED[what]
    found = faults(tmp_path, placed(HEAD + POWER, added))
    assert [fault.key for fault in found] == [key], found
    assert reason in found[0].reason
    assert found[0].expected
    assert found[0].line > 0


@pytest.mark.parametrize(
    ("added", "reason"),
    [
        (f"[set]\na{THOUSAND} = 1", "is a key of 2003 characters"),
        (f"set.a{THOUSAND} = 1", "is a key of 2003 characters"),
        (f"[set.a{THOUSAND}]\nb = 1", "is a key of 2003 characters"),
        (f'[set]\n"a{THOUSAND}" = 1', "is a key of 2003 characters"),
        (f"[set]\na = {{b{THOUSAND} = 1}}", "holds a key of more than 50 parts"),
    ],
    ids=["key", "keys", "table", "quoted", "inline"],
)
def test_a_set_of_a_thousand_parts_is_told(tmp_path, added, reason):
    """It was a traceback."""
    assert [fault.reason for fault in faults(tmp_path, placed(HEAD + POWER, added))] == [reason]


@pytest.mark.promise("campaigns-8")
@pytest.mark.parametrize(
    ("text", "nearest"),
    [
        (HEAD.replace("sampling", "samplng") + POWER, "sampling"),
        (HEAD.replace("sobol", "soboll") + POWER, '"sobol"'),
        (HEAD + POWER.replace("transmit_power", "transmitpower"), "communication.transmit_power"),
        (HEAD + POWER.replace("communication", "comunication"), "communication.transmit_power"),
        (HEAD + POWER.replace("normal", "normall"), '"normal"'),
        (HEAD + LOOP.replace('"PI"', '"LQR"'), '"LQG"'),
        (HEAD + POWER + '[limits.margn]\nleast = "3 dB"\n', '"margin"'),
        (HEAD + '[set]\n"pointing.lines.missalignment.error" = "1 urad"\n', "pointing.lines.misalignment.error"),
    ],
)
def test_a_slip_of_the_pen_is_told_what_was_probably_meant(tmp_path, text, nearest):
    assert [fault.nearest for fault in faults(tmp_path, text)] == [nearest]


@pytest.mark.promise("campaigns-8")
def test_all_faults_come_at_once(tmp_path):
    text = HEAD.replace("sobol", "sobl") + POWER.replace("5 W", "5 m") + '[set]\n"terminals.leo_aperture" = "1"\n'
    found = faults(tmp_path, text + '[grid]\n"terminals.geo_aperture" = []\n[limits.nothing]\nleast = 1\n')
    assert len({fault.key for fault in found}) >= 4, found


def test_faults_of_the_mission_are_said_with_its_own_lines(tmp_path):
    found = faults(tmp_path, HEAD, changes=(('leo_aperture = "5 cm"', 'leo_aperture = "5 kg"'),))
    assert [(fault.key, fault.file.endswith("mission.toml")) for fault in found] == [("terminals.leo_aperture", True)]
    assert "[terminals]" in (tmp_path / "mission.toml").read_text(encoding="utf-8").splitlines()[found[0].line - 2]
    text = HEAD + '[set]\n"point_ahead.transverse_velocity" = "1 km/s"\n'
    found = faults(tmp_path, text)  # the key that no longer fits stands in the mission
    assert [fault.key for fault in found] == ["fine_pointing.reference.point_ahead"]


def test_a_fault_names_the_cell_that_alone_has_it(tmp_path):
    grid = '[grid]\n"beacon.divergence" = ["780 urad", "1 urad"]\n'
    (alone,) = faults(tmp_path, HEAD + grid)
    assert alone.reason.endswith("(in the cell beacon.divergence = 1 urad)")
    (every,) = faults(tmp_path, HEAD + grid + '[set]\n"fine_pointing.reference.point_ahead" = "0 urad"\n')
    assert "in the cell" not in every.reason
    assert every.key == "set.fine_pointing.reference.point_ahead"


def test_files_that_are_not_there_are_named(tmp_path):
    with pytest.raises(MissionError, match="the campaign file does not exist"):
        load_campaign(tmp_path / "none.toml")
    assert "does not exist" in faults(tmp_path, HEAD.replace("mission.toml", "none.toml"))[0].reason
    assert "does not exist" in faults(tmp_path, HEAD + '[grid]\nmirror = ["none.toml"]\n')[0].reason
    assert "is missing" in faults(tmp_path, HEAD.partition("\n")[2])[0].reason


VIBRATION = '[set]\n"fine_pointing.vibration.spectrum" = "table"\n'
OF_VIBRATION = '"fine_pointing.vibration.file" = '


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('mission = "mission.toml"', 'mission = "{there}/mission.toml"'),
        ("[inputs", '[set]\nmirror = "{there}/plain.toml"\n[inputs'),
        ("[inputs", '[grid]\nmirror = ["mirror.toml", "{there}/plain.toml"]\n[inputs'),
        ("[inputs", f'{VIBRATION}{OF_VIBRATION}"{{there}}/a.csv"\n[inputs'),
        ("[inputs", f'{VIBRATION}[grid]\n{OF_VIBRATION}["a.csv", "{{there}}/a.csv"]\n[inputs'),
    ],
    ids=["mission", "mirror", "mirror of a grid", "vibration", "vibration of a grid"],
)
def test_a_file_named_by_an_absolute_path_does_not_go_to_a_worker(tmp_path, old, new):
    (tmp_path / "a.csv").write_text("Hz, urad^2/Hz\n1, 1\n2, 1\n", encoding="utf-8")
    told = rf"campaign\.toml depends on {tmp_path}/\w+\.\w+, an absolute path that another machine would not find"
    absolute = (HEAD + POWER).replace(old, new.format(there=tmp_path), 1)
    with pytest.raises(CampaignError, match=told):
        bundle.packed(loaded(tmp_path, absolute), ())
    beside = absolute.replace(f', "{tmp_path}/a.csv"', "").replace(f"{tmp_path}/", "")
    assert bundle.opened(bundle.packed(loaded(tmp_path, beside), ())).campaign.rows == 256


def test_a_mirror_file_that_the_mission_names_absolutely_does_not_go_to_a_worker(tmp_path):
    path = written(tmp_path, HEAD + POWER)
    whole = (tmp_path / "mission.toml").read_text(encoding="utf-8")
    kept = "".join(f"\n[{each}" for each in whole.split("\n[")[1:] if not each.startswith("mirror"))
    for name, told in ((tmp_path / "plain.toml", "an absolute path"), ("plain.toml", None)):
        (tmp_path / "mission.toml").write_text(f'{whole.split("[")[0]}[mirror]\nfile = "{name}"\n{kept}')
        campaign = load_campaign(path)
        with pytest.raises(CampaignError, match=f"depends on {name}, {told}") if told else nullcontext():
            bundle.packed(campaign, ())


def test_a_row_whose_draws_make_no_mission_has_no_run_in_time(tmp_path):
    campaign = loaded(tmp_path, HEAD + LOOP + POWER.replace("0.2 W", "2 W"))
    columns, _ = sampling.rows(campaign, 0, 0, 256)
    row = int(np.argmin(columns["communication.transmit_power"]))
    with pytest.raises(CampaignError, match=r"communication\.transmit_power.*is not above 0 W"):
        Evaluator(campaign, {}).trace(0, row, lambda: None)


@pytest.mark.promise("campaigns-17")
def test_a_loop_or_a_day_needs_a_mission_that_has_one(tmp_path):
    assert "needs a mission with the table" in faults(tmp_path, HEAD + LOOP, whole=False)[0].reason
    keep = HEAD + 'keep = ["volume"]\n' + POWER
    assert loaded(tmp_path, keep).keep == ("volume",)
    path = written(tmp_path, keep)
    mission = (tmp_path / "mission.toml").read_text(encoding="utf-8")
    cut = mission[: mission.index("[orbit]")] + mission[mission.index("[mirror]") :]
    (tmp_path / "mission.toml").write_text(cut, encoding="utf-8")
    with pytest.raises(MissionError, match=re.escape("needs the mission's tables [orbit] and [operations]")):
        load_campaign(path)


def beyond(deviation, *, runs=256, instead=""):
    """What a campaign warns of whose transmit power has this deviation about 5 W."""
    return HEAD.replace("256", str(runs)) + POWER.replace("0.2 W", deviation) + instead


def test_draws_that_a_key_does_not_take_are_warned_of_with_their_share(tmp_path):
    (said,) = loaded(tmp_path, beyond("2.9 W")).warnings
    assert said.startswith("4.2 % of the draws of communication.transmit_power are not above 0 W: those rows will fail")
    assert '"log-uniform"' in said
    rare = "1.25 W"  # four deviations: 3.2e-5 of the draws
    assert loaded(tmp_path, beyond(rare)).warnings == ()
    assert "0.0032 % of the draws" in loaded(tmp_path, beyond(rare, runs=4096)).warnings[0]
    drawn_as = '[inputs."communication.transmit_power".drawn_as]\ndistribution = "normal"\n'
    assert (
        "0.62 %" in loaded(tmp_path, beyond("0.2 W", instead=f'{drawn_as}mean = "5 W"\ndeviation = "2 W"')).warnings[0]
    )
    outage = distributed("requirement.outage", 'distribution = "normal"\nmean = 0.5\ndeviation = 0.5')
    shaken = loaded(tmp_path, HEAD + outage, changes=(("[requirement]", JITTER + "[requirement]"),))
    assert "31.7 % of the draws of requirement.outage are not above 0 or not below 1:" in shaken.warnings[0]


def test_the_share_that_is_warned_of_is_that_of_rows_that_fail(tmp_path):
    """Of those with the least power: above them no row fails that these do not."""
    c = loaded(tmp_path, beyond("5 W", runs=1024))
    builder, (columns, _) = MissionBuilder(c), sampling.rows(c, 0, 0, 1024)
    failed = 0
    for watt in np.sort(columns["communication.transmit_power"])[:200]:
        try:
            builder.mission(0, {"communication.transmit_power": float(watt)})
        except CampaignError:
            failed += 1
    assert c.warnings[0].startswith("15.9 % of")
    assert failed == pytest.approx(0.1587 * 1024, abs=8)  # one for each Sobol set


def test_rows_that_would_all_be_the_same_are_refused(tmp_path):
    (found,) = faults(tmp_path, HEAD)
    assert (found.key, found.line) == ("runs", 3)
    assert "makes 256 rows that are all the same: nothing is drawn" in found.reason
    assert found.expected.startswith('runs = 1 with sampling = "random", one row for each cell')
    one = HEAD.replace("256", "1")
    (found,) = faults(tmp_path, one)
    assert (found.key, "makes 16 rows" in found.reason) == ("sampling", True)
    one, grid = one.replace("sobol", "random"), '[grid]\n"terminals.leo_aperture" = ["5 cm", "6 cm"]\n'
    assert (len(loaded(tmp_path, one + grid).cells), loaded(tmp_path, one + grid).rows) == (2, 1)
    precision = '[precision]\noutput = "margin"\nquantile = 0.1\nhalf_width = "1 dB"\nconfidence = 0.9\nat_most = 9\n'
    (found,) = faults(tmp_path, one + precision)
    assert (found.key, "and no [precision]" in found.expected) == ("precision.at_most", True)
    assert loaded(tmp_path, HEAD + LOOP).rows == loaded(tmp_path, HEAD + POWER).rows == 256
    wrong = HEAD + POWER.replace("5 W", "5 m")
    assert [fault.key for fault in faults(tmp_path, wrong)] == ["inputs.communication.transmit_power.mean"]


def test_a_required_limit_that_limits_leave_out_is_warned_of(tmp_path):
    margin, quantile = '[limits.margin]\nleast = "2 dB"\n', '[limits.residual_quantile]\nmost = "9 urad"\n'
    (said,) = loaded(tmp_path, HEAD + LOOP + margin).warnings
    assert said.startswith("[limits] leaves out residual_quantile, so that requirement.pointing_error = 10 µrad is not")
    advice = said.partition("[limits.residual_quantile] with ")[2].partition(" checks")[0]
    mended = loaded(tmp_path, f"{HEAD}{LOOP}{margin}[limits.residual_quantile]\n{advice}\n")
    assert (mended.warnings, mended.limits[1].most) == ((), 1e-5)
    assert "[limits.margin] with least = " in loaded(tmp_path, HEAD + LOOP + quantile).warnings[0]
    assert loaded(tmp_path, HEAD + LOOP + margin + quantile).warnings == ()
    assert loaded(tmp_path, HEAD + LOOP).warnings == ()
    assert loaded(tmp_path, f'{HEAD}keep = ["margin"]\n{LOOP}{margin}').warnings == ()
    varied = '[grid]\n"requirement.pointing_error" = ["9 urad", "8 urad"]\n'  # no single value that could be checked
    assert loaded(tmp_path, HEAD + LOOP + margin + varied).warnings == ()


def test_a_mirror_that_was_not_identified_is_told_where_one_goes(tmp_path):
    (found,) = faults(tmp_path, HEAD + IDENTIFIED)
    assert found.expected.startswith('[set] with mirror = "FILE", or [grid] with mirror = ["FILE"]')
    for table in ('[set]\nmirror = "mirror.toml"\n', '[grid]\nmirror = ["mirror.toml"]\n'):
        assert len(loaded(tmp_path, HEAD + IDENTIFIED + table).inputs) == 3


@pytest.mark.parametrize(
    ("output", "example", "width"),
    [
        ("margin", '"0.05 dB"', 0.05),
        ("radius", '"0.05 urad"', 5e-8),
        ("data_rate", '"0.05 Mbit/s"', 5e4),
        ("outage", "0.001", 1e-3),
    ],
)
def test_a_precision_is_shown_a_half_width_in_the_unit_of_its_output(tmp_path, output, example, width):
    text = f'{HEAD}{LOOP}{POWER}[precision]\noutput = "{output}"\nat_most = 1000\n'
    found = {fault.key: fault.expected for fault in faults(tmp_path, text)}
    assert found.keys() == {"precision.quantile", "precision.half_width", "precision.confidence"}
    assert found["precision.half_width"].endswith(f"; for example half_width = {example}")
    assert found["precision.quantile"].endswith("for example quantile = 0.99")
    text += "quantile = 0.99\nconfidence = 0.99\n"
    assert loaded(tmp_path, f"{text}half_width = {example}\n").half_width == pytest.approx(width, rel=1e-12)
    (wrong,) = faults(tmp_path, text + 'half_width = "1 kg"\n')
    assert wrong.expected.endswith(f"; for example half_width = {example}")


def test_radius_is_among_what_a_precision_may_ask_for_and_no_limit(tmp_path):
    precision = '[precision]\noutput = "radios"\nquantile = 0.9\nhalf_width = 1\nconfidence = 0.9\nat_most = 1000\n'
    (found,) = faults(tmp_path, HEAD + LOOP + precision)
    assert (found.nearest, found.expected.endswith(", radius")) == ('"radius"', True)
    (found,) = faults(tmp_path, f'{HEAD}{LOOP}[limits.radius]\nmost = "1 urad"\n')
    assert "radius" not in found.expected


def test_a_ledger_is_no_campaign_file_and_the_other_way_round(tmp_path):
    path = tmp_path / "a b.ledger"
    file.make_empty(path)
    with pytest.raises(MissionError, match="is a ledger, not a campaign file") as caught:
        load_campaign(path)
    assert "microrad campaign resume '" in caught.value.faults[0].expected
    text = written(tmp_path, HEAD + POWER)
    with pytest.raises(CampaignError, match=rf"is no ledger, .* begin it with `microrad campaign run {text}`"):
        file.refuse_foreign(text)
    (tmp_path / "table.csv").write_text("row\n1\n")
    with pytest.raises(CampaignError, match="is no ledger, or its first page is damaged: name the file"):
        file.refuse_foreign(tmp_path / "table.csv")


def test_a_campaign_file_whose_path_is_longer_than_sqlite_takes_is_read(tmp_path):
    folder = tmp_path
    while len(str(folder)) < 600:
        folder /= "f" * 100
    folder.mkdir(parents=True)
    path = written(folder, HEAD + POWER)
    assert load_campaign(path).rows == 256
    with pytest.raises(CampaignError, match="cannot read whether it is a ledger"):
        file.refuse_foreign(path)


def test_more_runs_than_noise_streams_have_numbers_for(tmp_path):
    text = HEAD.replace("runs = 256", "runs = 4294967296")
    assert loaded(tmp_path, text + POWER).rows == 2**32
    found = faults(tmp_path, f"{text}realisations = 2\n{LOOP}{NOISE}")
    assert [(fault.key, "4294967296 rows of 2 runs" in fault.reason) for fault in found] == [("runs", True)]


# ---------------------------------------------------------------------------------------------------- missions of rows
@pytest.mark.promise("campaigns-14")
def test_a_row_has_the_drawn_values_to_the_last_bit(tmp_path):
    c = loaded(tmp_path, f'{HEAD}{LOOP}{POWER}{NOISE}{IDENTIFIED}[set]\nmirror = "mirror.toml"\n')
    builder = MissionBuilder(c)
    columns, _ = sampling.rows(c, 0, 0, 16)
    for i in range(16):
        values = {key: float(column[i]) for key, column in columns.items()}
        file = builder.mission(0, values)
        m = file.mission
        assert m.communication.transmit_power_w == values["communication.transmit_power"]
        assert m.fine_pointing.optical_sensor.noise_rad == values["fine_pointing.optical_sensor.noise"]
        assert m.mirror.bouc_wen.d1_rad_v == values["mirror.bouc_wen.d1"]
        assert m.mirror.linear.poles_hz == (values["mirror.linear.poles.1"],)
        assert m.mirror.uncertainty is None
        assert m.mirror.bouc_wen.beta_1_v == 0.6
        for key in ("communication.transmit_power", "mirror.bouc_wen.d1"):
            assert file.sources[key].comment.startswith("campaign: drawn")
        assert file.sources["terminals.leo_aperture"].comment.startswith("paper")
    assert builder.mission(0, {}) is c.cells[0].file
    assert builder.mission(0, {"mirror.bouc_wen.d1": 9e-5}).mission.mirror.uncertainty is None
    assert c.cells[0].file.mission.mirror.uncertainty is not None


@pytest.mark.promise("readme-12")
def test_a_row_is_the_mission_that_a_file_with_its_values_would_be(tmp_path):
    c = loaded(tmp_path, HEAD + POWER + distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "7 cm"]'))
    row = MissionBuilder(c).mission(0, {"communication.transmit_power": 4.5, "terminals.leo_aperture": 0.07}).mission
    text = SHIPPED.read_text(encoding="utf-8")
    for old, new in (('transmit_power = "5 W"', 'transmit_power = "4.5 W"'), ('= "5 cm"', '= "7 cm"')):
        text = text.replace(old, new)
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    assert row == load_mission(tmp_path / "own.toml").mission
    assert row != c.mission.mission


def test_words_of_a_table_are_drawn_by_their_place(tmp_path):
    body = TABLE + 'values = ["decibel", "ratio"]\nweights = [1, 3]'
    c = loaded(tmp_path, HEAD + distributed("conventions.strehl", body))
    assert c.inputs[0].distribution == "one of 1 = decibel, 2 = ratio, weights 0.25, 0.75"
    columns, _ = sampling.rows(c, 0, 0, 256)
    drawn = columns["conventions.strehl"]
    assert set(drawn) == {1.0, 2.0}
    assert np.mean(drawn == 2.0) == 0.75  # eight Sobol sets
    builder = MissionBuilder(c)
    words = [builder.mission(0, {"conventions.strehl": place}).mission.conventions.strehl for place in (1.0, 2.0)]
    assert words == ["decibel", "ratio"]


def test_whole_numbers_of_a_table_stay_whole(tmp_path):
    c = loaded(tmp_path, 'keep = ["volume"]\n' + HEAD + distributed("acquisition.attempts", TABLE + "values = [1, 2]"))
    assert MissionBuilder(c).mission(0, {"acquisition.attempts": 2.0}).mission.acquisition.attempts == 2


@pytest.mark.promise("campaigns-12")
@pytest.mark.parametrize(
    ("key", "head", "jitter"),
    [
        ("constellation.satellites", "", False),
        ("requirement.outage", "", False),
        ("communication.pointing_error", "", True),
        ("acquisition.detection_frames", "", False),
        ("beacon.transmit_power", 'keep = ["margin", "answer_margin"]\n', False),
        ("requirement.margin", 'keep = ["outage"]\n', False),
    ],
)
def test_a_drawn_key_that_nothing_reads_is_refused_by_name(tmp_path, key, head, jitter):
    whole = TABLE + "values = [2, 3]"
    body = {"detection_frames": whole, "satellites": whole, "outage": TABLE + "values = [0.01, 0.02]"}
    quantities = {"pointing_error": '"1 urad", "2 urad"', "transmit_power": '"1 W", "2 W"', "margin": '"1 dB", "2 dB"'}
    last = key.rpartition(".")[2]
    changes = [("[requirement]", JITTER + "[requirement]")] if jitter else []
    (found,) = faults(
        tmp_path,
        head + HEAD + distributed(key, body.get(last) or f"{TABLE}values = [{quantities.get(last)}]"),
        changes=tuple(changes),
    )
    assert found.key == f"inputs.{key}"
    assert found.reason.startswith("is read by nothing that is kept (")
    assert ("jitter.bias or jitter.rms" in found.expected) is jitter


@pytest.mark.promise("campaigns-12")
@pytest.mark.parametrize("jitter", [False, True], ids=["static", "jitter"])
def test_every_drawable_key_moves_an_output_or_is_refused(tmp_path, jitter):
    """Each quantity of the mission is drawn about its value; those that are refused are those that move nothing."""
    changes = [("[requirement]", JITTER + "[requirement]")] if jitter else []
    data = open_mission(written(tmp_path, HEAD, changes=tuple(changes)).parent / "mission.toml").data
    found, inputs = {}, ""
    for text, value in keys.flat(data).items():
        with suppress(keys.UnknownKeyError, ValueError):
            key = keys.find(text, data)
            if key.numeric is not None:
                at = key.numeric.read(value)
                found[text] = at, 0.999 * at  # inside of its bounds
                values = [json.dumps(key.written(each)) for each in (0.998 * at, at, 0.999 * at)][: 3 if at else 1]
                inputs += distributed(text, f"{TABLE}values = [{', '.join(values)}]")
    assert len(found) > 140
    with pytest.raises(MissionError) as caught:
        loaded(tmp_path, HEAD + inputs + '[limits.margin]\nleast = "2 dB"\n', changes=tuple(changes))
    refused = {fault.key.removeprefix("inputs.") for fault in caught.value.faults}
    assert {fault.reason.partition(" (")[0] for fault in caught.value.faults} == {"is read by nothing that is kept"}
    plain = loaded(tmp_path, HEAD + POWER, changes=tuple(changes))
    builder, names = MissionBuilder(plain), plain.keep
    own, moved = evaluate.outputs(builder.mission(0, {}), None, names), {}
    for text, (at, near) in found.items():
        if at:
            with suppress(CampaignError):  # a period that divides no other
                other = evaluate.outputs(builder.mission(0, {text: near}), None, names)
                moved[text] = other != pytest.approx(own, rel=1e-12)
    assert len(moved) > 110
    cancelled = {"beacon.wavelength", "answer.wavelength"}  # in a beam of given divergence
    assert {text for text in moved if not moved[text]} == (refused & moved.keys()) | cancelled


def test_a_drawn_key_is_read_where_one_cell_reads_it(tmp_path):
    body = f'{TABLE}values = ["1 urad", "2 urad"]'
    grid = '[grid]\n"conventions.pointing_loss" = ["gaussian", "gain"]\n'
    assert loaded(tmp_path, HEAD + distributed("communication.pointing_error", body) + grid).draws


@pytest.mark.promise("campaigns-8")
def test_a_row_that_is_no_mission_says_key_value_and_reason(tmp_path):
    c = loaded(tmp_path, HEAD + POWER)
    with pytest.raises(CampaignError, match=r'communication\.transmit_power = "-1\.0 W" is not above 0 W'):
        MissionBuilder(c).mission(0, {"communication.transmit_power": -1.0})
    with pytest.raises(CampaignError, match=r"beacon\.divergence = 1e-06 rad is below diffraction"):
        MissionBuilder(c).mission(0, {"beacon.divergence": 1e-6})
    assert (
        MissionBuilder(c).mission(0, {"communication.transmit_power": 1.0}).mission.communication.transmit_power_w
        == 1.0
    )


@pytest.mark.promise("campaigns-13", "campaigns-14")
def test_mirrors_of_a_grid_are_each_drawn_from_their_own_covariance(tmp_path):
    path = written(tmp_path, f'{HEAD}{IDENTIFIED}[grid]\nmirror = ["mirror.toml", "other.toml"]\n')
    text = (tmp_path / "mirror.toml").read_text(encoding="utf-8")
    other = text[: text.index("[uncertainty]")].replace('poles = ["1 kHz"]', 'poles = ["2 kHz"]')
    other += '[uncertainty]\nparameters = ["linear.poles.1", "bouc_wen.epsilon"]\nstandard_errors = [0.02, 0.1]\n'
    (tmp_path / "other.toml").write_text(other, encoding="utf-8")
    c = load_campaign(path)
    assert len(c.inputs) == 4  # what either mirror has
    first, second = (sampling.rows(c, cell, 0, 64)[0] for cell in (0, 1))
    assert np.all(np.isnan(second["mirror.bouc_wen.d1"]))
    assert np.all(np.isnan(first["mirror.bouc_wen.epsilon"]))
    assert 1900 < np.mean(second["mirror.linear.poles.1"]) < 2100
    values = {key: float(column[3]) for key, column in second.items()}
    m = MissionBuilder(c).mission(1, values).mission
    assert m.mirror.bouc_wen.epsilon_rad_v == values["mirror.bouc_wen.epsilon"]
    assert m.mirror.bouc_wen.d1_rad_v == pytest.approx(0.089e-3, rel=1e-12)


def test_a_list_that_scales_together_is_one_column(tmp_path):
    path = written(tmp_path, f'{HEAD}{IDENTIFIED}[set]\nmirror = "mirror.toml"\n')
    text = (tmp_path / "mirror.toml").read_text(encoding="utf-8")
    text = text.replace(UNCERTAINTY, '\n[uncertainty]\nparameters = ["linear.poles"]\nstandard_errors = [0.1]\n')
    text = text.replace(
        'poles = ["1 kHz"]\npole_dampings = [0.5]', 'poles = ["1 kHz", "2 kHz"]\npole_dampings = [0.5, 1.0]'
    )
    (tmp_path / "mirror.toml").write_text(text, encoding="utf-8")
    c = load_campaign(path)
    assert [(each.key, each.unit) for each in c.inputs] == [("mirror.linear.poles", "")]
    m = MissionBuilder(c).mission(0, {"mirror.linear.poles": 1.5}).mission
    assert m.mirror.linear.poles_hz == (1500.0, 3000.0)
    plain = text.replace('"linear.poles"', '"linear.pole_dampings"').replace("[0.5, 1.0]", "[0.5, 0.25]")
    (tmp_path / "mirror.toml").write_text(plain, encoding="utf-8")
    c = load_campaign(path)
    m = MissionBuilder(c).mission(0, {"mirror.linear.pole_dampings": 1.5}).mission
    assert m.mirror.linear.pole_dampings == (0.75, 0.375)
    with pytest.raises(
        CampaignError, match=r"mirror\.linear\.pole_dampings = \[1\.25, 0\.625\] item 1: 1\.25 is above 1"
    ):
        MissionBuilder(c).mission(0, {"mirror.linear.pole_dampings": 2.5})
    creep = text.replace('"linear.poles"', '"creep.weights"').replace(
        "\n[uncertainty]",
        '\n[creep]\ntime_constants = ["1 s", "9 s"]\nweights = ["2 urad/V", "1e-6 rad/V"]\n\n[uncertainty]',
    )
    (tmp_path / "mirror.toml").write_text(creep, encoding="utf-8")
    m = MissionBuilder(load_campaign(path)).mission(0, {"mirror.creep.weights": 1.5}).mission
    assert m.mirror.creep.weights_rad_v == pytest.approx((3e-6, 1.5e-6), rel=1e-12)


# ---------------------------------------------------------------------------------------------------------- same loop?
def leaves(table, prefix=""):
    for name, info in type(table).model_fields.items():
        value, key = getattr(table, name), f"{prefix}{info.alias or name}"
        if isinstance(value, dict):
            for each, inner in value.items():
                yield from leaves(inner, f"{key}.{each}.")
        elif hasattr(type(value), "model_fields"):
            yield from leaves(value, f"{key}.")
        elif isinstance(value, float) and math.isfinite(value):
            yield key, value


def moved(table, key, value):
    """A mission with another value, past all checks."""
    name, _, rest = key.partition(".")
    fields = {info.alias or field: field for field, info in type(table).model_fields.items()}
    inner = getattr(table, fields[name])
    if isinstance(inner, dict):
        each, _, rest = rest.partition(".")
        return table.model_copy(update={fields[name]: {**inner, each: moved(inner[each], rest, value)}})
    return table.model_copy(update={fields[name]: moved(inner, rest, value) if rest else value})


@pytest.mark.parametrize("sensor", ["noise", "quad cell"])
def test_only_keys_that_touch_the_loop_change_it(tmp_path, sensor):
    """Every number of the mission is moved in turn, and the loop built anew."""
    written(tmp_path, HEAD, changes=(QUAD_CELL,) if sensor == "quad cell" else ())
    file = load_mission(tmp_path / "mission.toml")

    def loop_of(m):
        scene = scene_of(replace(file, mission=m))
        return pickle.dumps((scene.loop, scene.axis, m.fine_pointing.modulus_margin, m.fine_pointing.seed))

    same, changed = loop_of(file.mission), []
    for key, value in leaves(file.mission):
        try:
            if loop_of(moved(file.mission, key, 1.01 * value if value else 0.01)) != same:
                changed.append(key)
        except (ValueError, ArithmeticError):
            continue  # plant_step and such, which the loop looks at
    assert {"fine_pointing.strain_gauge.noise", "mirror.bouc_wen.d1", "amplifier.gain"} <= set(changed)
    assert [key for key in changed if not keys.touches_loop(key, file.mission)] == []
    assert ("terminals.leo_aperture" in changed) == (sensor == "quad cell")
    assert keys.touches_loop("answer.wavelength", file.mission) == (sensor == "quad cell")
    assert not keys.touches_loop("communication.transmit_power", file.mission)
    assert keys.touches_loop("conventions.mirror_angle", file.mission)  # a word


@pytest.mark.promise("campaigns-6")
def test_rows_with_the_same_loop_have_the_same_key(tmp_path):
    text = f'{HEAD}{LOOP}{POWER}{NOISE}[grid]\n"terminals.geo_aperture" = ["15 cm", "20 cm"]\n'
    text += '"fine_pointing.strain_gauge.noise" = ["0.1 urad", "0.2 urad"]\n'
    builder = MissionBuilder(loaded(tmp_path, text))
    power, noise = "communication.transmit_power", "fine_pointing.optical_sensor.noise"
    one = builder.loop_key(0, {power: 4.0, noise: 1e-6})
    assert one == builder.loop_key(0, {power: 5.0, noise: 1e-6})
    assert one != builder.loop_key(0, {power: 4.0, noise: 2e-6})
    assert one != builder.loop_key(1, {power: 4.0, noise: 1e-6})  # another gauge
    assert one == builder.loop_key(2, {power: 4.0, noise: 1e-6})  # another partner's aperture
    assert hash(one) == hash(builder.loop_key(2, {power: 4.0, noise: 1e-6}))


SENSITIVITY = 'receiver_sensitivity = "291.2 photon/bit" #'
RECEIVER = """receiver.modulation = "qpsk"
receiver.detector = "heterodyne"
receiver.efficiency = 0.7
receiver.bit_error_ratio = 1e-7
receiver.code = "dvb-s2-1-2"
receiver.bandwidth = "4 GHz"
receiver.phase_error = "50 mrad"
receiver.inter_symbol_loss = "0.3 dB" #"""


@pytest.mark.promise("link-97")
def test_a_rows_receiver_has_its_drawn_phase_error_and_loss(tmp_path):
    drawn = "".join(
        f'[inputs."communication.receiver.{key}"]\ndistribution = "uniform"\nlow = "{low}"\nhigh = "{high}"\n'
        for key, low, high in (("phase_error", "20 mrad", "90 mrad"), ("inter_symbol_loss", "0.1 dB", "1 dB"))
    )
    c = loaded(tmp_path, HEAD + drawn, changes=((SENSITIVITY, RECEIVER),))
    columns, _ = sampling.rows(c, 0, 0, 8)
    phases, losses = columns["communication.receiver.phase_error"], columns["communication.receiver.inter_symbol_loss"]
    assert np.ptp(phases) > 0.03
    margins = []
    for phase, loss in zip(phases, losses, strict=True):
        values = {"communication.receiver.phase_error": float(phase), "communication.receiver.inter_symbol_loss": 0.5}
        m = MissionBuilder(c).mission(0, values).mission
        assert m.communication.receiver.phase_error_rad == phase
        assert 0.1 <= loss <= 1.0
        margins.append(float(link.margin_of_error(link.of(m), 1e-5)))
    assert np.all(np.diff(np.asarray(margins)[np.argsort(phases)]) < 0.0)


def test_every_wrong_key_and_value_of_a_grid_is_told_at_once(tmp_path):
    grid = """[grid]
"terminals.leo_aperture" = "5 cm"
"terminals.geo_apertures" = ["15 cm"]
"communication.pointing_error" = ["1 kg"]
"""
    told = {fault.key: fault.reason for fault in faults(tmp_path, HEAD + POWER + grid)}
    assert list(told) == [
        "grid.terminals.leo_aperture",
        "grid.terminals.geo_apertures",
        "grid.communication.pointing_error",
    ]
    wrong = ("is not a list", "is no key", "another kind")
    assert [words in reason for words, reason in zip(wrong, told.values(), strict=True)] == [True] * 3


def test_a_key_that_one_cell_of_a_grid_reads_may_be_drawn(tmp_path, monkeypatch):
    """Whichever it is; in no cell it would change no number."""

    def of_gaussian_beams(file, runs, names):
        mission = file.mission
        return mission.communication.transmit_power_w if mission.conventions.pointing_loss == "gaussian" else 0.0

    monkeypatch.setattr(evaluate, "outputs", of_gaussian_beams)
    for order in ('"gain", "gaussian"', '"gaussian", "gain"'):
        loaded(tmp_path, HEAD + POWER + f'[grid]\n"conventions.pointing_loss" = [{order}]\n')
    (found,) = faults(tmp_path, HEAD + POWER + '[grid]\n"conventions.pointing_loss" = ["gain"]\n')
    assert found.reason.startswith("is read by nothing that is kept (")


def test_files_that_a_key_draws_are_sought_beside_the_mission(tmp_path):
    """The campaign may lie in another folder."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    changes = (('\nspectrum = "olympus"', '\nspectrum = "table"\nfile = "a.csv"'),)
    drawn = '[inputs."fine_pointing.vibration.file"]\ndistribution = "table"\nvalues = ["a.csv", "b.csv"]\n'
    path = written(there, HEAD.replace("mission.toml", "../there/mission.toml") + LOOP + drawn, changes=changes)
    for name in ("a.csv", "b.csv"):
        (there / name).write_text("Hz, urad^2/Hz\n1, 1\n2, 1\n", encoding="utf-8")
    found = load_campaign(path.rename(here / "campaign.toml"))
    assert {"a.csv", "b.csv"} <= {file.name for file in found.files}
    (there / "b.csv").unlink()
    with pytest.raises(MissionError) as caught:
        load_campaign(here / "campaign.toml")
    assert [(Path(fault.value.strip('"')).name, fault.reason) for fault in caught.value.faults] == [
        ("b.csv", "is named by the mission and does not exist")
    ]


def test_weights_of_inputs_that_are_drawn_from_other_distributions_multiply(tmp_path):
    """Each is the ratio of both densities at what was drawn."""
    text = HEAD
    for key, (mean, deviation), (other, wider) in (
        ("communication.transmit_power", (5.0, 0.2), (4.7, 0.4)),
        ("communication.pointing_error", (3.0, 0.1), (3.2, 0.3)),
    ):
        unit = "W" if key.endswith("power") else "urad"
        text += f'[inputs."{key}"]\ndistribution = "normal"\nmean = "{mean} {unit}"\ndeviation = "{deviation} {unit}"\n'
        text += f'[inputs."{key}".drawn_as]\ndistribution = "normal"\nmean = "{other} {unit}"\n'
        text += f'deviation = "{wider} {unit}"\n'
    columns, weights = sampling.rows(loaded(tmp_path, text), 0, 0, 64)
    power, error = columns["communication.transmit_power"], columns["communication.pointing_error"] * 1e6
    ratios = [
        norm.pdf(power, 5.0, 0.2) / norm.pdf(power, 4.7, 0.4),
        norm.pdf(error, 3.0, 0.1) / norm.pdf(error, 3.2, 0.3),
    ]
    assert weights == pytest.approx(ratios[0] * ratios[1], rel=1e-9)
    assert np.abs(np.log(ratios[0])).max() > 0.5


# --------------------------------------------------------------------------------------------------- in whole sentences
def test_what_is_drawn_in_vain_is_told_with_all_that_is_kept(tmp_path):
    text = HEAD + 'keep = ["beacon_margin", "answer_margin"]\n' + POWER
    (fault,) = faults(tmp_path, text)
    assert (fault.key, fault.reason, fault.expected) == (
        "inputs.communication.transmit_power",
        "is read by nothing that is kept (beacon_margin, answer_margin): it would change no number",
        "a key that they depend on, or another output in `keep`",
    )


@pytest.mark.parametrize(
    ("key", "path"),
    [
        ("communication.transmit_power", ("communication", "transmit_power_w")),
        ("pointing.lines.misalignment.error", ("pointing", "lines", (reads.KEY, "misalignment"), "error_rad")),
        ("scenario.pid_frequencies.2", ("scenario", "pid_frequencies_hz")),
        ("pointing.lines.body_pointing.class", ("pointing", "lines", (reads.KEY, "body_pointing"), "kind")),
        ("name", ("name",)),
    ],
)
def test_a_key_is_read_at_its_field_or_in_the_list_that_holds_it(key, path):
    assert campaign_file._path(load_mission(SHIPPED).mission, key) == (0, "mission", *path)


@pytest.mark.parametrize(
    ("known", "digests", "read"),
    [
        (True, (), False),
        (False, (), True),
        (True, (("a", "b"),), True),
        (True, (("a", reads.WHOLE),), True),
        (True, ((reads.WHOLE,),), True),
        (True, (("a", "b", reads.WHOLE),), False),
        (True, (("a",), ("b",)), False),
    ],
)
def test_a_value_is_read_by_itself_or_with_a_record_that_holds_it(known, digests, read):
    seen = SimpleNamespace(known=known, digests=dict.fromkeys(digests))
    assert campaign_file._is_read(seen, ("a", "b")) is read


def test_a_fault_of_one_cell_has_its_values_and_one_of_all_has_none(tmp_path):
    grid = '[grid]\n"mirror.bias" = ["6 V", "13 V"]\n"requirement.margin" = ["1 dB", "2 dB"]\n'
    (fault,) = faults(tmp_path, HEAD + POWER + grid)
    assert (fault.key, fault.value) == ("grid.mirror.bias", '"13 V"')
    assert fault.reason == (
        "is outside drive_min to drive_max (0 V to 12 V) (in the cell mirror.bias = 13 V, requirement.margin = 1 dB)"
    )
    assert fault.expected == "0 V to 12 V"
    (fault,) = faults(
        tmp_path, HEAD + POWER + '[set]\n"mirror.bias" = "13 V"\n[grid]\n"requirement.margin" = ["1 dB"]\n'
    )
    assert (fault.key, fault.value) == ("set.mirror.bias", '"13 V"')
    assert fault.reason == "is outside drive_min to drive_max (0 V to 12 V)"


def test_cells_of_two_axes_run_the_last_fastest_with_sources_of_the_file(tmp_path):
    grid = '[set]\n"communication.distance" = "40000 km" # of ours\n'
    grid += '[grid]\n"terminals.leo_aperture" = ["5 cm", "62.5 mm"]\n'
    grid += '"communication.data_rate" = ["622.08 Mbit/s", "1 Gbit/s"] # both\n'
    found = loaded(tmp_path, HEAD + POWER + grid)
    assert [cell.label for cell in found.cells] == [
        f"terminals.leo_aperture = {aperture}, communication.data_rate = {rate}"
        for aperture in ("5 cm", "62.5 mm")
        for rate in ("622.08 Mbit/s", "1 Gbit/s")
    ]
    rates = [cell.file.mission.communication.data_rate_bit_s for cell in found.cells]
    assert rates == [622.08e6, 1e9, 622.08e6, 1e9]
    assert [cell.file.mission.terminals.leo_aperture_m for cell in found.cells] == [0.05, 0.05, 0.0625, 0.0625]
    sources = found.cells[2].file.sources
    told = [sources[key] for key in ("communication.distance", "terminals.leo_aperture", "communication.data_rate")]
    assert [(each.comment, each.value, each.file) for each in told] == [
        ("campaign: of ours", "40000 km", "campaign file"),
        ("campaign: [grid]", "62.5 mm", "campaign file"),
        ("campaign: both", "622.08 Mbit/s", "campaign file"),
    ]
    assert [each.line for each in told] == [
        line_of(tmp_path, name) for name in ("distance", "leo_aperture", "data_rate")
    ]
    assert found.fixed == {"communication.distance": "40000 km"}
    assert found.mission.mission.communication.data_rate_bit_s == 300e6


@pytest.mark.parametrize(
    ("grid", "key", "reason", "expected"),
    [
        (
            '"terminals.leo_aperture" = []',
            "terminals.leo_aperture",
            "is not a list with something in it",
            "the values of the grid: [first, second]",
        ),
        (
            '"terminals.leo_aperture" = ["5 cm", "6 cm", "5 cm"]',
            "terminals.leo_aperture",
            "stands twice",
            "each value once",
        ),
        (
            '"terminals.leo_aperture" = ["5 cm", "50 mm"]',
            "terminals.leo_aperture",
            "stands twice, before as 5 cm",
            "each value once",
        ),
        (
            '"scenario.pid_frequencies" = [["2 Hz", "3 Hz"], ["2000 mHz", "3 Hz"]]',
            "scenario.pid_frequencies",
            "stands twice, before as [2 Hz, 3 Hz]",
            "each value once",
        ),
        (
            'mirror = ["mirror.toml", 3]',
            "mirror",
            "is no path",
            'a mirror file, seen from the campaign file: "mirror.toml"',
        ),
    ],
)
def test_a_grid_that_is_none_says_what_would_be_one(tmp_path, grid, key, reason, expected):
    (fault,) = faults(tmp_path, HEAD + POWER + f"[grid]\n{grid}\n")
    assert (fault.key, fault.reason, fault.expected) == (f"grid.{key}", reason, expected)


def test_an_identified_mirror_beside_its_own_parameter_or_without_uncertainty_is_told_in_full(tmp_path):
    both = '[set]\nmirror = "mirror.toml"\n'
    both += distributed("mirror.bouc_wen.alpha", 'distribution = "uniform"\nlow = "2 1/V"\nhigh = "3 1/V"')
    (fault,) = faults(tmp_path, HEAD + LOOP + IDENTIFIED + both)
    assert (fault.key, fault.reason, fault.expected) == (
        "inputs.mirror",
        "draws mirror.bouc_wen.alpha, which the campaign gives too",
        "one of the two removed",
    )
    (fault,) = faults(tmp_path, HEAD + LOOP + IDENTIFIED + '[grid]\nmirror = ["mirror.toml", "plain.toml"]\n')
    assert fault.reason == 'is to be identified, but the mirror "plain mirror of a test" has no table uncertainty'
    found = loaded(tmp_path, HEAD + LOOP + IDENTIFIED + '[grid]\nmirror = ["mirror.toml"]\n')
    assert [(each.key, each.unit, each.distribution) for each in found.inputs] == [
        ("mirror.bouc_wen.d1", "rad/V", "identified, standard error 2 %"),
        ("mirror.bouc_wen.alpha", "1/V", "identified, standard error 3 %"),
        ("mirror.linear.poles.1", "Hz", "identified, standard error 1 %"),
    ]


def test_what_is_rounded_up_is_told_with_both_numbers(tmp_path):
    noise = HEAD.replace("runs = 256", "runs = 300\nrealisations = 65") + LOOP + NOISE
    assert loaded(tmp_path, noise).warnings == (
        "runs = 300 is rounded up to 320 rows, whole sets of sobol sampling",
        "realisations = 65 takes as long as 128: runs are advanced 64 side by side",
    )
    assert [block_rows(runs) for runs in (1, 127, 128, 255, 256, 300, 32767, 32768, 10**6)] == [
        *(16, 16, 16, 16, 32, 32, 2048, 4096, 4096)
    ]


# ----------------------------------------------------------------------------- each fault of a file with its whole line
PRECISE = '[precision]\noutput = "{}"\nquantile = {}\nhalf_width = "{}"\nconfidence = {}\nat_most = {}\n'
OPTIMISE = (
    '[optimise]\nminimise = "{}"\nconfidence = {}\nrows = {}\nevaluations = {}\n'
    '[optimise.variables."terminals.leo_aperture"]\nlow = "{}"\nhigh = "{}"\n'
)
RANGE = '[inputs."{}"]\ndistribution = "uniform"\nlow = "1 Hz"\nhigh = "2 Hz"\n'
DRAWN_AS = '[inputs."communication.transmit_power".drawn_as]\ndistribution = "{}"\n{}\n'
WHOLE_FAULTS = {
    "a misspelt word, distribution and path": (
        HEAD.replace("sobol", "latin") + POWER.replace("normal", "norml") + '[set]\nmirror = ""\n',
        """
        4 sampling = "latin" is none of the choices: sampling = "random" or sampling = "latin-hypercube" or sampling
        = "sobol" (); 6 inputs.communication.transmit_power.distribution = "norml" is none of the choices:
        distribution = "normal" or distribution = "uniform" or distribution = "log-uniform" or distribution =
        "table" or distribution = "identified" ("normal"); 10 set.mirror = "" is no path: a mirror file, seen from
        the campaign file: "mirror.toml" ()
        """,
    ),
    "values of two axes": (
        HEAD + POWER + '[grid]\n"terminals.leo_aperture" = [5, "6 cm", "7 kg"]\n"fine_pointing.runs" = [8, 8.5]\n',
        """
        10 grid.terminals.leo_aperture = 5 is a number without a unit: a length with its unit; for example
        leo_aperture = "5 cm" (); 10 grid.terminals.leo_aperture = "7 kg" is in "kg", another kind of quantity: a
        length with its unit; for example leo_aperture = "5 cm" (); 11 grid.fine_pointing.runs = 8.5 is not a whole
        number: a whole number without quotes, from 1 to 100000; for example runs = 2 ()
        """,
    ),
    "numbers of a precision": (
        HEAD + POWER + PRECISE.format("margin", 1.5, "0 dB", 0.9, 0),
        """
        11 precision.quantile = 1.5 is not above 0 and below 1: a number without quotes, above 0 and below 1; for
        example quantile = 0.99 (); 14 precision.at_most = 0 is below 1: a whole number without quotes, from 1 to
        4294967296; for example at_most = 2 ()
        """,
    ),
    "a half width": (
        HEAD + POWER + PRECISE.format("margin", 0.5, "0 dB", 0.9, 512),
        """
        12 precision.half_width = "0 dB" is not above 0 dB: a ratio in decibels with its unit, above 0 dB; for
        example half_width = "0.05 dB" ()
        """,
    ),
    "an optimisation": (
        HEAD + POWER + OPTIMISE.format("margin", 0.9, 8, 0, "5 cm", "50 mm"),
        """
        12 optimise.rows = 8 is below 16: a whole number without quotes, from 16 to 1000000; for example rows = 16
        (); 13 optimise.evaluations = 0 is below 1: a whole number without quotes, from 1 to 100000; for example
        evaluations = 2 ()
        """,
    ),
    "bounds of a variable": (
        HEAD + POWER + OPTIMISE.format("margin", 0.9, 64, 50, "5 cm", "50 mm"),
        """
        16 optimise.variables.terminals.leo_aperture.high = "50 mm" is not above low ("5 cm"): a range that goes up
        ()
        """,
    ),
    "two variables' units": (
        HEAD + POWER + OPTIMISE.format("-terminals.leo_apertur", 0.9, 64, 50, "5 kg", 4),
        """
        10 optimise.minimise = "-terminals.leo_apertur" is neither a variable of the optimisation nor an output: one
        of terminals.leo_aperture, (all outputs) ("-terminals.leo_aperture"); 15
        optimise.variables.terminals.leo_aperture.low = "5 kg" is in "kg", another kind of quantity: a length with
        its unit; for example low = "5 cm" (); 16 optimise.variables.terminals.leo_aperture.high = "4" is a number
        without a unit: a length with its unit; for example high = "4 cm" ()
        """,
    ),
    "a list and its item": (
        HEAD + RANGE.format("scenario.pid_frequencies") + RANGE.format("scenario.pid_frequencies.1"),
        """
        9 inputs.scenario.pid_frequencies.1 =  is an item of scenario.pid_frequencies, which stands in [inputs] as a
        whole: the list, or its items, in one of the two tables ()
        """,
    ),
    "limits of two kinds": (
        HEAD
        + IDENTIFIED
        + "mean = 2\n"
        + '[limits.margin]\nleast = "5 dB"\nmost = "4 dB"\n[limits.answer_margins]\nmost = 3\n',
        """
        7 inputs.mirror.mean = 2 is no key of [inputs.mirror]: one of distribution (); 10 limits.margin.most = "4
        dB" is not above least: a range that goes up (); 11 limits.answer_margins = "answer_margins" is no output:
        one of (all outputs) ("answer_margin")
        """,
    ),
    "a key of a limit": (
        HEAD + POWER + '[limits.margin]\nleest = "5 dB"\n',
        """
        10 limits.margin.leest = "5 dB" is no key of [limits.margin]: one of least, most (least)
        """,
    ),
    "another mission": (
        HEAD.replace("mission.toml", "no.toml") + POWER,
        """
        0  =  the mission file does not exist: an existing file; `microrad init` writes one to start from ()
        """,
    ),
    "numbers of the head": (
        HEAD.replace("= 1", "= 1.5").replace("256", "2.0")
        + 'worst = 101\nrow_limit = "0 s"\nrealisations = 0\n'
        + POWER,
        """
        2 seed = 1.5 is not a whole number: a whole number without quotes, from 0 to 18446744073709551615; for
        example seed = 2 (); 3 runs = 2.0 is not a whole number: a whole number without quotes, from 1 to
        4294967296; for example runs = 2 (); 5 worst = 101 is above 100: a whole number without quotes, from 0 to
        100; for example worst = 2 (); 6 row_limit = "0 s" is not above 0 s: a time with its unit, above 0 s, at
        most 1000000000 s; for example row_limit = "5 s" (); 7 realisations = 0 is below 1: a whole number without
        quotes, from 1 to 1000000; for example realisations = 2 ()
        """,
    ),
    "a loop and a tail": (
        HEAD + LOOP.replace("1 s", "2e9 s") + NOISE + '[tail]\nerror = "20 urad"\nprobability = 2\n',
        """
        7 loop.duration = "2e9 s" is above 1000000000 s: a time with its unit, above 0 s, at most 1000000000 s; for
        example duration = "5 s" (); 14 tail.probability = 2 is not above 0 and below 1: a number without quotes,
        above 0 and below 1; for example probability = 0.5 ()
        """,
    ),
    "a tail of a loop that varies": (
        HEAD + "realisations = 3\n" + LOOP + NOISE + '[tail]\nerror = "20 urad"\nprobability = 1e-6\n',
        """
        5 realisations =  stands beside [tail], whose rows are single errors: one of the two removed (); 9
        inputs.fine_pointing.optical_sensor.noise =  changes the loop, and a table [tail] needs the same loop in all
        rows: the mission's own value, or a grid of values ()
        """,
    ),
    "tables that are none": (
        'set = 3\ngrid = "a"\ninputs = []\nlimits = false\n' + HEAD,
        """
        1 set = 3 is no table: [set] with a key on each line below it (); 2 grid = "a" is no table: [grid] with a
        key on each line below it (); 3 inputs = [] is no table: [inputs] with a key on each line below it (); 4
        limits = false is no table: [limits] with a key on each line below it ()
        """,
    ),
    "a settling that is all": (
        HEAD + LOOP + 'settle = "1 s"\n' + POWER,
        """
        7 loop.duration =  leaves 1 s, all of it settling (1 s): duration = "4 s" would do ()
        """,
    ),
    "an output without a loop": (
        HEAD + 'keep = ["margin", "residual_rms"]\n' + POWER,
        """
        5 keep = "residual_rms" needs the fine-pointing loop: a table [loop], or this output left out ()
        """,
    ),
    "a radius without a loop": (
        HEAD + POWER + PRECISE.format("radius", 0.5, "1 urad", 0.9, 512),
        """
        10 precision.output = "radius" needs the fine-pointing loop: a table [loop], or another output ()
        """,
    ),
    "a distribution in place of itself": (
        HEAD + POWER + DRAWN_AS.format("identified", ""),
        """
        9 inputs.communication.transmit_power.drawn_as =  is no distribution that an input can be drawn as: a normal
        one, for example ()
        """,
    ),
}


@pytest.mark.parametrize("what", WHOLE_FAULTS)
def test_each_fault_of_a_file_is_told_with_its_line_and_what_would_do(tmp_path, what):
    text, told = WHOLE_FAULTS[what]
    found = "; ".join(
        f"{f.line} {f.key} = {f.value} {f.reason}: {f.expected} ({f.nearest})" for f in faults(tmp_path, text)
    )
    assert one_line(found) == one_line(told.replace("(all outputs)", ", ".join(OUTPUTS)))


@pytest.mark.parametrize(
    ("text", "rows", "most", "block", "realisations", "varies", "width"),
    [
        (HEAD + POWER, 256, 256, 32, 1, False, math.nan),
        (HEAD.replace("256", "17") + POWER, 32, 32, 16, 1, False, math.nan),
        (HEAD.replace("256", "129").replace("sobol", "latin-hypercube") + POWER, 144, 144, 16, 1, False, math.nan),
        (HEAD.replace("256", "129").replace("sobol", "random") + POWER, 129, 129, 16, 1, False, math.nan),
        (HEAD + "realisations = 3\n" + LOOP + POWER, 256, 256, 32, 3, False, math.nan),
        (HEAD + LOOP + NOISE, 256, 256, 32, 64, True, math.nan),
        (HEAD + "realisations = 5\n" + LOOP + NOISE, 256, 256, 32, 5, True, math.nan),
        (HEAD + POWER + PRECISE.format("margin", 0.01, "50 mdB", 0.9, 300), 256, 320, 32, 1, False, 0.05),
        (HEAD + POWER + PRECISE.format("data_rate", 0.01, "0.5 Mbit/s", 0.9, 256), 256, 256, 32, 1, False, 5e5),
        (HEAD + LOOP + POWER + PRECISE.format("radius", 0.99, "0.5 urad", 0.9, 999), 256, 1024, 32, 1, False, 5e-7),
    ],
)
def test_rows_come_in_whole_blocks_and_runs_as_the_loop_wants(
    tmp_path, text, rows, most, block, realisations, varies, width
):
    c = loaded(tmp_path, text.replace('"50 mdB"', '"0.05 dB"'))
    assert (c.rows, c.most_rows, c.block, c.realisations, c.loop_varies) == (rows, most, block, realisations, varies)
    assert c.half_width == pytest.approx(width, rel=1e-12, nan_ok=True)


@pytest.mark.parametrize(
    ("low", "high", "is_log", "middle"),
    [(1e-6, 1e-5, True, 1e-5 / math.sqrt(10.0)), (0.04, 0.4, True, 0.4 / math.sqrt(10.0)), (1e-6, 9e-6, False, 5e-6)],
)
def test_a_variable_below_1_is_searched_by_ratios_too(low, high, is_log, middle):
    variable = Variable("a", "rad", low, high)
    assert (variable.log, variable.at(0.5)) == (is_log, pytest.approx(middle, rel=1e-12))
    assert type(variable.at(np.float64(0.25))) is float


def test_the_largest_rate_is_solved_for_in_each_cell_before_any_row(tmp_path):
    text = f'{HEAD}{POWER}[set]\n"communication.data_rate" = "largest"\n"requirement.margin" = "4 dB"\n'
    found = loaded(tmp_path, text + '[grid]\n"terminals.leo_aperture" = ["5 cm", "6.25 cm"]\n').cells
    rates = [cell.file.mission.communication.data_rate_bit_s for cell in found]
    assert rates[0] > 1e6 and rates[0] != rates[1]
    assert [cell.data["communication"]["data_rate"] for cell in found] == [f"{each!r} bit/s" for each in rates]
    margins = [evaluate.outputs(cell.file, None, ("margin",))["margin"] for cell in found]
    assert margins == pytest.approx([4.0, 4.0], abs=1e-6)


@pytest.mark.parametrize(
    ("wanted", "drawn", "covered"),
    [
        (((1.0, 2.0), ("a", "b"), True), ((1.0, 2.0), ("1 m", "2 m"), False), False),
        (((1.0, 2.0), ("1 m", "2 m"), False), ((1.0, 2.0), ("a", "b"), True), False),
        (((1.0, 2.0), ("a", "b"), True), ((1.0, 2.0), ("b", "a"), True), False),
        (((1.0, 2.0), ("a", "b"), True), ((1.0, 2.0), ("a", "b"), True), True),
        (((1.0, 2.0), ("1 m", "2 m"), False), ((3.0, 2.0, 1.0), ("3 m", "2 m", "100 cm"), False), True),
        (((1.0, 4.0), ("1 m", "4 m"), False), ((3.0, 2.0, 1.0), ("3 m", "2 m", "1 m"), False), False),
    ],
)
def test_words_stand_for_words_in_their_places_alone(wanted, drawn, covered):
    of = [
        OneOf(values, (1.0 / len(values),) * len(values), written, words) for values, written, words in (wanted, drawn)
    ]
    assert uncovered(*of) == ("" if covered else "does not draw every value of the table")


# ------------------------------------------------------------------------------------------------- the mission of a row
def test_the_mission_of_a_row_says_of_each_drawn_value_where_it_is_from(tmp_path):
    listed = distributed("conventions.pointing_loss", TABLE + 'values = ["gain", "gaussian"]')
    c = loaded(
        tmp_path, HEAD + POWER + listed + distributed("terminals.leo_aperture", TABLE + 'values = ["5 cm", "62.5 mm"]')
    )
    builder = MissionBuilder(c)
    assert builder.mission(0, {}) is c.cells[0].file
    power, loss, aperture = (each.key for each in c.inputs)
    row = builder.mission(0, {power: 4.875, loss: 2.0, aperture: 0.0625})
    assert [(s.line, s.comment, s.value, s.file) for s in (row.sources[key] for key in (power, loss, aperture))] == [
        (0, "campaign: drawn, 4.875 W", "4.875 W", "campaign file"),
        (0, "campaign: drawn, gaussian", "gaussian", "campaign file"),
        (0, "campaign: drawn, 62.5 mm", "62.5 mm", "campaign file"),
    ]
    m = row.mission
    assert (m.communication.transmit_power_w, m.conventions.pointing_loss, m.terminals.leo_aperture_m) == (
        *(4.875, "gaussian", 0.0625),
    )
    own = c.cells[0].file
    assert m.beacon is own.mission.beacon and row.sources["beacon.divergence"] == own.sources["beacon.divergence"]


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"communication.transmit_power": -1.5}, 'communication.transmit_power = "-1.5 W" is not above 0 W'),
        (
            {"communication.transmit_power": 0.0, "terminals.leo_aperture": -0.25, "requirement.outage": 1.0},
            'terminals.leo_aperture = "-0.25 m" is not above 0 m; communication.transmit_power = "0.0 W" is not above '
            "0 W; requirement.outage = 1.0 is not above 0 and below 1",
        ),
    ],
)
def test_a_row_that_is_no_mission_says_each_key_with_its_value_up_to_three(tmp_path, values, told):
    builder = MissionBuilder(loaded(tmp_path, HEAD + POWER))
    with pytest.raises(CampaignError) as error:
        builder.mission(0, values)
    assert str(error.value) == f"the row is no mission: {told}"
    many = {f"terminals.{side}_aperture": -1.0 for side in ("leo", "geo")}
    many |= {f"communication.{key}": -1.0 for key in ("transmit_power", "wavelength", "distance")}
    with pytest.raises(CampaignError) as error:
        builder.mission(0, many)
    assert str(error.value).count("is not above") == 3


def test_the_loop_of_a_row_goes_by_the_values_of_its_grid_and_draws_that_it_looks_at(tmp_path):
    grid = '[grid]\n"fine_pointing.strain_gauge.noise" = ["0.1 urad", "0.2 urad"]\n'
    grid += '"communication.distance" = ["40000 km"]\n'
    builder = MissionBuilder(loaded(tmp_path, HEAD + LOOP + NOISE + POWER + grid))
    noise, power = "fine_pointing.optical_sensor.noise", "communication.transmit_power"
    assert builder.loop_key(1, {power: 5.0, noise: 1e-6}) == (
        ("fine_pointing.strain_gauge.noise", "0.2 urad"),
        (noise, 1e-6),
    )
    assert builder.loop_key(0, {power: 5.0}) == (("fine_pointing.strain_gauge.noise", "0.1 urad"),)
    assert builder.several_axes(0, {noise: 1e-6}) is None


def test_a_drawn_list_of_an_identified_mirror_goes_by_a_factor_and_leaves_no_uncertainty(tmp_path):
    c = loaded(tmp_path, HEAD + LOOP + IDENTIFIED + '[set]\nmirror = "mirror.toml"\n')
    d1, alpha, pole = (each.key for each in c.inputs)
    row = MissionBuilder(c).mission(0, {d1: 9e-5, alpha: math.nan, pole: 1.25e3})
    m = row.mission.mirror
    assert (m.bouc_wen.d1_rad_v, m.uncertainty, m.linear.poles_hz) == (9e-5, None, (1250.0,))
    assert m.bouc_wen.alpha_1_v == c.cells[0].mirror.bouc_wen.alpha_1_v, "what is not drawn stays"
    assert alpha not in row.sources or "drawn" not in row.sources[alpha].comment
    assert c.cells[0].mirror.uncertainty is not None


def test_a_drawn_list_of_a_grid_of_identified_mirrors_is_that_of_each_ones_own(tmp_path):
    """Poles that are moved by one factor are the mirror's of that cell."""
    written(tmp_path, "")
    own = (tmp_path / "mirror.toml").read_text(encoding="utf-8").replace("linear.poles.1", "linear.poles")
    (pole,) = re.findall(r"poles = \[.*\]", own)
    other = own.replace(pole, 'poles = ["400 Hz", "700 Hz"]').replace("dampings = [0.5]", "dampings = [0.5, 0.2]")
    for name, text in (("one.toml", own), ("other.toml", other)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    c = loaded(tmp_path, HEAD + LOOP + IDENTIFIED + '[grid]\nmirror = ["one.toml", "other.toml"]\n')
    key = next(each.key for each in c.inputs if each.key.startswith("mirror.linear.poles"))
    rows = [MissionBuilder(c).mission(cell, {key: 1.25}).mission.mirror.linear.poles_hz for cell in (0, 1)]
    assert rows == [(1250.0,), (500.0, 875.0)]


@pytest.mark.parametrize(("at_most", "shown"), [(16, "16"), (200, "200")])
def test_rows_that_are_too_few_are_told_as_they_stand_in_the_file(tmp_path, at_most, shown):
    (fault,) = faults(tmp_path, HEAD + POWER + PRECISE.format("margin", 0.1, "1 dB", 0.9, at_most))
    assert (fault.key, fault.value, fault.line) == ("precision.at_most", shown, line_of(tmp_path, "at_most"))


def test_a_table_that_holds_only_others_is_told_on_the_line_of_the_first(tmp_path):
    tail = (
        '[limits.margin]\nleast = "3 dB"\n[limits.outage]\nmost = 0.1\n[tail]\nerror = "12 urad"\nprobability = 1e-6\n'
    )
    (fault,) = faults(tmp_path, HEAD + LOOP + tail)
    assert (fault.key, fault.line) == ("limits", line_of(tmp_path, "limits.margin"))


def test_a_precision_without_half_width_of_what_is_no_output_is_told_both(tmp_path):
    text = '[precision]\noutput = "margins"\nquantile = 0.1\nconfidence = 0.9\nat_most = 1000\n'
    found = {fault.key: fault for fault in faults(tmp_path, HEAD + POWER + text)}
    assert found.keys() == {"precision.output", "precision.half_width"}
    assert found["precision.output"].nearest == '"margin"'
    assert "text in quotes" not in found["precision.half_width"].expected


def test_a_drawn_switch_is_told_as_the_file_has_it(tmp_path):
    c = loaded(tmp_path, HEAD + distributed("point_ahead.corrected", TABLE + "values = [false, true]"))
    told = MissionBuilder(c).mission(0, {"point_ahead.corrected": 1.0})
    assert told.mission.point_ahead.corrected is False
    source = told.sources["point_ahead.corrected"]
    assert (source.value, source.comment) == ("false", "campaign: drawn, false")


def test_a_mission_that_the_middle_of_all_draws_leaves_not_is_told_of_its_cell_and_of_the_key_to_blame(tmp_path):
    """The first cell that has none is told, whichever it is, and of two drawn keys the one that the fault names."""
    bias = distributed("mirror.bias", 'distribution = "uniform"\nlow = "10.5 V"\nhigh = "11.5 V"')
    for most, label in (('"12 V", "10 V", "9 V"', "10 V"), ('"9 V", "12 V", "10 V"', "9 V")):
        grid = f'[grid]\n"mirror.drive_max" = [{most}]\n'
        (fault,) = faults(tmp_path, HEAD + POWER + bias + grid)
        assert fault.key == "inputs.mirror.bias"
        assert fault.reason.startswith(
            f"leaves no mission in the middle of all distributions of the cell mirror.drive_max = {label}: "
            f"the row is no mission: mirror.bias = 11.0 V is outside drive_min to drive_max (0 V to {label})"
        )
        assert fault.expected == "distributions about a mission that works"


def test_an_error_that_the_link_has_no_use_for_is_told_by_what_stands_in_its_place(tmp_path):
    """Under [jitter] that is the jitter, and under a loop its runs, with [jitter] or without."""
    error = distributed("communication.pointing_error", 'distribution = "uniform"\nlow = "1 urad"\nhigh = "2 urad"')
    changes = (("[requirement]", JITTER + "[requirement]"),)
    (alone,) = faults(tmp_path, HEAD + error, changes=changes)
    assert alone.expected == (
        "jitter.bias or jitter.rms: under the table [jitter] the margin is that of requirement.outage"
    )
    for more in (changes, ()):
        (looped,) = faults(tmp_path, HEAD + LOOP + error, changes=more)
        assert looped.key == "inputs.communication.pointing_error"
        assert looped.expected == "a key that they depend on, or another output in `keep`"


def test_each_value_of_a_grid_that_stands_twice_is_told_with_the_first_of_its_own(tmp_path):
    grid = '[grid]\n"terminals.leo_aperture" = ["5 cm", "6 cm", "50 mm", "7 cm", "60 mm", "0.05 m", "7 cm"]\n'
    assert [(fault.value, fault.reason) for fault in faults(tmp_path, HEAD + POWER + grid)] == [
        ('"50 mm"', "stands twice, before as 5 cm"),
        ('"60 mm"', "stands twice, before as 6 cm"),
        ('"0.05 m"', "stands twice, before as 5 cm"),
        ('"7 cm"', "stands twice"),
    ]


def test_a_fault_of_a_cell_is_told_where_its_key_stands_with_the_value_that_it_has_there(tmp_path):
    """In [set], in [grid] or in the mission; a fault for another reason than without the grid is that of its cell."""
    least, most = '[grid]\n"mirror.drive_max" = [{}]\n', '[set]\n"mirror.bias" = "13 V"\n'
    (fault,) = faults(tmp_path, HEAD + POWER + most + least.format('"11 V", "11.5 V"'))
    assert (fault.key, fault.value, Path(fault.file).name) == ("set.mirror.bias", '"13 V"', "campaign.toml")
    assert fault.reason == ("is outside drive_min to drive_max (0 V to 11 V) (in the cell mirror.drive_max = 11 V)")
    (fault,) = faults(tmp_path, HEAD + POWER + least.format('"12 V", "5 V"'))
    assert (fault.key, fault.value, Path(fault.file).name) == ("mirror.bias", '"6 V"', "mission.toml")
    assert fault.reason == "is outside drive_min to drive_max (0 V to 5 V) (in the cell mirror.drive_max = 5 V)"
    assert fault.line > 0
    two = '[grid]\n"mirror.drive_max" = ["12 V", "11 V"]\n"mirror.bias" = ["6 V", "11.5 V"]\n'
    (fault,) = faults(tmp_path, HEAD + POWER + two)
    assert (fault.key, fault.value) == ("grid.mirror.bias", '"11.5 V"')
    assert fault.reason.endswith(" (in the cell mirror.drive_max = 11 V, mirror.bias = 11.5 V)")


def test_a_parameter_of_the_second_of_two_identified_mirrors_is_given_by_nothing_else(tmp_path):
    """Neither drawn by itself nor in [set]; one that neither mirror is known in may be."""
    body = 'distribution = "uniform"\nlow = "0.5 1/V"\nhigh = "0.7 1/V"'
    grid = '[grid]\nmirror = ["mirror.toml", "other.toml"]\n'
    for more in (distributed("mirror.bouc_wen.beta", body), '[set]\n"mirror.bouc_wen.beta" = "0.7 1/V"\n'):
        path = written(tmp_path, HEAD + LOOP + IDENTIFIED + grid + more)
        own = (tmp_path / "mirror.toml").read_text(encoding="utf-8")
        (tmp_path / "other.toml").write_text(own, encoding="utf-8")
        assert len(load_campaign(path).inputs) == 3 + more.startswith("[inputs")
        (tmp_path / "other.toml").write_text(own.replace('"linear.poles.1"', '"bouc_wen.beta"'), encoding="utf-8")
        with pytest.raises(MissionError) as caught:
            load_campaign(path)
        assert [(fault.key, fault.reason) for fault in caught.value.faults] == [
            ("inputs.mirror", "draws mirror.bouc_wen.beta, which the campaign gives too")
        ]


def test_each_input_that_its_key_does_not_take_everywhere_is_warned_of_by_what_is_drawn(tmp_path):
    """Behind a mirror, which is never warned of; by the distribution that is drawn in place of the input's own."""
    normal = 'distribution = "normal"\nmean = "{}"\ndeviation = "1 dB"'
    loss = distributed("communication.implementation_loss", normal.format("2 dB"))
    loss += distributed("communication.implementation_loss.drawn_as", normal.format("1 dB")).replace(
        '"communication.implementation_loss.drawn_as"', '"communication.implementation_loss".drawn_as'
    )
    other = distributed("communication.receive_optics_loss", normal.format("1.5 dB"))
    text = HEAD + IDENTIFIED + loss + other + '[set]\nmirror = "mirror.toml"\n'
    said = [each.partition(":")[0] for each in loaded(tmp_path, text).warnings]
    assert said == [
        f"{100.0 * norm.cdf(-1.0):.3g} % of the draws of communication.implementation_loss are below 0 dB",
        f"{100.0 * norm.cdf(-1.5):.2g} % of the draws of communication.receive_optics_loss are below 0 dB",
    ]


def test_a_parameter_of_two_mirrors_is_told_by_the_first_and_one_of_the_second_alone_by_that(tmp_path):
    path = written(tmp_path, HEAD + IDENTIFIED + '[grid]\nmirror = ["mirror.toml", "other.toml"]\n')
    other = (tmp_path / "mirror.toml").read_text(encoding="utf-8").partition("[uncertainty]")[0]
    other += '[uncertainty]\nparameters = ["linear.poles.1", "bouc_wen.beta"]\nstandard_errors = [0.05, 0.0725]\n'
    (tmp_path / "other.toml").write_text(other, encoding="utf-8")
    assert [(each.key, each.unit, each.distribution) for each in load_campaign(path).inputs] == [
        ("mirror.bouc_wen.d1", "rad/V", "identified, standard error 2 %"),
        ("mirror.bouc_wen.alpha", "1/V", "identified, standard error 3 %"),
        ("mirror.linear.poles.1", "Hz", "identified, standard error 1 %"),
        ("mirror.bouc_wen.beta", "1/V", "identified, standard error 7.25 %"),
    ]


def test_a_key_in_three_tables_is_told_twice_with_the_first_of_them(tmp_path):
    own = '[set]\n"communication.transmit_power" = "4 W"\n[grid]\n"communication.transmit_power" = ["3 W", "2 W"]\n'
    told = [(fault.key, fault.reason) for fault in faults(tmp_path, HEAD + POWER + own)]
    assert told == [
        ("inputs.communication.transmit_power", "stands in [set] too"),
        ("grid.communication.transmit_power", "stands in [set] too"),
    ]


def test_an_item_may_be_drawn_of_a_list_that_stands_in_a_grid(tmp_path):
    """It is put into the list of each cell, whose other items stay."""
    grid = '[grid]\n"jitter.rms" = [["3 urad", "4 urad"], ["5 urad", "6 urad"]]\n'
    drawn = distributed("jitter.rms.2", 'distribution = "uniform"\nlow = "1 urad"\nhigh = "2 urad"')
    found = loaded(tmp_path, HEAD + drawn + grid, changes=(("[requirement]", JITTER + "[requirement]"),))
    builder = MissionBuilder(found)
    rows = [builder.mission(cell, {"jitter.rms.2": 1.5e-6}).mission.jitter.rms_rad for cell in (0, 1)]
    assert rows == [(3e-6, 1.5e-6), (5e-6, 1.5e-6)]


def test_a_file_that_is_drawn_by_an_absolute_path_does_not_go_to_a_worker(tmp_path):
    """The second of two values; by relative paths both go along."""
    changes = (('\nspectrum = "olympus"', '\nspectrum = "table"\nfile = "a.csv"'),)
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("Hz, urad^2/Hz\n1, 1\n2, 1\n", encoding="utf-8")
    drawn = '[inputs."fine_pointing.vibration.file"]\ndistribution = "table"\nvalues = ["a.csv", "{}b.csv"]\n'
    absolute, beside = (
        read_definition(written(tmp_path, HEAD + LOOP + drawn.format(where), changes=changes))[0]
        for where in (f"{tmp_path}/", "")
    )
    with pytest.raises(CampaignError, match=rf"campaign\.toml depends on {tmp_path}/b\.csv, an absolute path"):
        bundle.packed(absolute, ())
    found = bundle.opened(bundle.packed(beside, ()))
    names = ["campaign.toml", "mission.toml", "a.csv", "b.csv"]
    assert [file.name for file in found.campaign.files] == names
    assert all(file.is_file() and file.parent != tmp_path for file in found.campaign.files)


def test_a_campaign_depends_on_each_file_of_its_mission_its_cells_and_its_draws_once(tmp_path):
    """The mission's own mirror, those of a grid, and what a mission of any cell or a draw names, in that order."""
    grid = '[grid]\nmirror = ["plain.toml", "mirror.toml", "third.toml"]\n'
    drawn = '[inputs."fine_pointing.vibration.file"]\ndistribution = "table"\nvalues = ["b.csv", "a.csv", "c.csv"]\n'
    changes = (('\nspectrum = "olympus"', '\nspectrum = "table"\nfile = "a.csv"'),)
    path = written(tmp_path, HEAD + LOOP + drawn + grid, changes=changes)
    whole = (tmp_path / "mission.toml").read_text(encoding="utf-8")
    kept = "".join(f"\n[{each}" for each in whole.split("\n[")[1:] if not each.startswith("mirror"))
    own = f'{whole.split("[")[0]}[mirror]\nfile = "mirror.toml"\n{kept}'
    (tmp_path / "mission.toml").write_text(own, encoding="utf-8")
    (tmp_path / "third.toml").write_text((tmp_path / "plain.toml").read_text(encoding="utf-8"), encoding="utf-8")
    for name in "abc":
        (tmp_path / f"{name}.csv").write_text("Hz, urad^2/Hz\n1, 1\n2, 1\n", encoding="utf-8")
    names = ["campaign.toml", "mission.toml", "mirror.toml", "plain.toml", "third.toml", "a.csv", "b.csv", "c.csv"]
    assert [each.relative_to(tmp_path).as_posix() for each in read_definition(path)[0].files] == names
    (tmp_path / "c.csv").unlink()
    (tmp_path / "a.csv").unlink()
    with pytest.raises(MissionError) as caught:
        read_definition(path)
    assert [(fault.key, Path(fault.value.strip('"')).name) for fault in caught.value.faults] == [
        ("mission", "a.csv"),
        ("mission", "c.csv"),
    ]


def test_lists_and_switches_are_drawn_by_their_places_with_their_weights(tmp_path):
    rms = '[["1 urad", "2 urad"], ["3 urad", "4 urad"], ["2 urad", "1 urad"]]'
    lists = distributed("jitter.rms", f"{TABLE}values = {rms}\nweights = [1, 2.5, 1.5]")
    switch = distributed("point_ahead.corrected", f"{TABLE}values = [false, true]\nweights = [3, 1]")
    changes = (("[requirement]", JITTER + "[requirement]"),)
    found = loaded(tmp_path, HEAD + lists + switch, changes=changes)
    first, second = (draw.distribution for draw in found.draws)
    assert (first.values, first.is_words) == ((1.0, 2.0, 3.0), True)
    assert first.probabilities == pytest.approx((0.2, 0.5, 0.3))
    assert (second.values, second.is_words) == ((1.0, 2.0), True)
    assert second.probabilities == (0.75, 0.25)
    builder = MissionBuilder(found)
    for place, switched, own, corrected in ((2.0, 1.0, (3e-6, 4e-6), False), (3.0, 2.0, (2e-6, 1e-6), True)):
        m = builder.mission(0, {"jitter.rms": place, "point_ahead.corrected": switched}).mission
        assert m.jitter.rms_rad == pytest.approx(own)
        assert m.point_ahead.corrected is corrected
    twice = rms.replace('["2 urad", "1 urad"]', '["1000 nrad", "2 urad"]')
    (fault,) = faults(tmp_path, HEAD + distributed("jitter.rms", f"{TABLE}values = {twice}"), changes=changes)
    assert (fault.key, fault.reason) == ("inputs.jitter.rms.values", "has a value twice")


def test_variables_of_an_optimisation_may_stand_in_tables_inside_each_other(tmp_path):
    """Each table by its dotted key in one, by its names in another, and both ways in a third."""
    head = f'{HEAD}{POWER}[optimise]\nminimise = "-margin"\nconfidence = 0.99\nrows = 64\nevaluations = 50\n'
    limit = '[limits.margin]\nleast = "2 dB"\n'
    small, large = 'low = "3 cm"\nhigh = "12 cm"\n', 'low = "15 cm"\nhigh = "20 cm"\n'
    wide = 'low = "600 urad"\nhigh = "900 urad"\n'
    tables = (
        '[optimise.variables."terminals.leo_aperture"]\n{}[optimise.variables."terminals.geo_aperture"]\n{}'
        '[optimise.variables."beacon.divergence"]\n{}',
        "[optimise.variables.terminals.leo_aperture]\n{}[optimise.variables.terminals.geo_aperture]\n{}"
        "[optimise.variables.beacon.divergence]\n{}",
        '[optimise.variables.terminals]\nleo_aperture = {{ low = "3 cm", high = "12 cm" }}\n'
        'geo_aperture.low = "15 cm"\ngeo_aperture.high = "20 cm"\n[optimise.variables."beacon.divergence"]\n{2}',
    )
    found = [loaded(tmp_path, head + each.format(small, large, wide) + limit) for each in tables]
    wanted = [
        ("terminals.leo_aperture", 0.03, 0.12),
        ("terminals.geo_aperture", 0.15, 0.2),
        ("beacon.divergence", 600e-6, 900e-6),
    ]
    for each in found:
        assert [(v.key, v.low, v.high) for v in each.variables] == [
            (key, pytest.approx(low), pytest.approx(high)) for key, low, high in wanted
        ]
        assert list(each.table.optimise.variables) == [key for key, _, _ in wanted]


def test_a_grid_and_what_an_input_is_drawn_as_may_stand_in_tables_inside_tables(tmp_path):
    own = 'distribution = "normal"\nmean = "4 W"\ndeviation = "0.25 W"\n'
    wider = 'distribution = "normal"\nmean = "4.5 W"\ndeviation = "0.5 W"\n'
    leo, geo, far = '["6 cm", "8 cm"]', '["15 cm", "20 cm", "25 cm"]', '["600 urad", "700 urad"]'
    quoted = (
        f'[inputs."communication.transmit_power"]\n{own}[inputs."communication.transmit_power".drawn_as]\n{wider}'
        f'[grid]\n"terminals.geo_aperture" = {geo}\n"beacon.divergence" = {far}\n"terminals.leo_aperture" = {leo}\n'
    )
    nested = (
        f"[inputs.communication.transmit_power]\n{own}[inputs.communication.transmit_power.drawn_as]\n{wider}"
        f"[grid]\nterminals.geo_aperture = {geo}\nbeacon = {{ divergence = {far} }}\nterminals.leo_aperture = {leo}\n"
    )
    head = HEAD.replace("sobol", "random")
    one, other = loaded(tmp_path, head + quoted), loaded(tmp_path, head + nested)
    assert one.draws == other.draws
    assert one.draws[0].distribution != one.draws[0].drawn_as is not None
    # the tables of a file are in the order in which each begins: both of the terminals' before the beacon's
    assert list(other.cells[0].values) == ["terminals.geo_aperture", "terminals.leo_aperture", "beacon.divergence"]
    assert list(one.cells[0].values) == ["terminals.geo_aperture", "beacon.divergence", "terminals.leo_aperture"]
    assert len(one.cells) == 12
    assert sorted(sorted(cell.values.items()) for cell in one.cells) == sorted(
        sorted(cell.values.items()) for cell in other.cells
    )
    apertures = {
        (cell.file.mission.terminals.leo_aperture_m, cell.values["terminals.leo_aperture"]) for cell in one.cells
    }
    assert apertures == {(0.06, "6 cm"), (0.08, "8 cm")}


def test_a_variable_that_is_drawn_or_set_too_is_told_with_the_first_table_that_has_it(tmp_path):
    """The first variable is drawn, the second stands alone, the third in [set] and in [grid]."""
    bounds = 'low = "4 W"\nhigh = "6 W"\n', 'low = "15 cm"\nhigh = "20 cm"\n', 'low = "3 cm"\nhigh = "12 cm"\n'
    names = "communication.transmit_power", "terminals.geo_aperture", "terminals.leo_aperture"
    tables = "".join(f'[optimise.variables."{name}"]\n{own}' for name, own in zip(names, bounds, strict=True))
    body = (
        f'{POWER}[set]\n"terminals.leo_aperture" = "6 cm"\n[grid]\n"terminals.leo_aperture" = ["7 cm", "8 cm"]\n'
        f'[optimise]\nminimise = "-margin"\nconfidence = 0.99\nrows = 64\nevaluations = 50\n{tables}'
        '[limits.margin]\nleast = "2 dB"\n'
    )
    told = [(fault.key, fault.reason, fault.expected) for fault in faults(tmp_path, HEAD + body)]
    expected = "the key in one of the two tables"
    assert told == [
        ("grid.terminals.leo_aperture", "stands in [set] too", expected),
        ("optimise.variables.communication.transmit_power", "stands in [inputs] too", expected),
        ("optimise.variables.terminals.leo_aperture", "stands in [set] too", expected),
    ]


@pytest.mark.parametrize("item_in", ["set", "grid", "inputs", "optimise.variables"])
@pytest.mark.parametrize("list_in", ["set", "grid", "inputs", "optimise.variables"])
def test_an_item_may_stand_in_a_table_behind_that_of_its_list_where_this_is_set_or_a_grid(list_in, item_in):
    """The list is the second key of its table, and the item stands behind another one of a list of its own."""
    order = ["set", "grid", "inputs", "optimise.variables"]
    tables = {name: {f"{name}.first": 1} for name in order}
    tables[list_in]["jitter.rms"] = 2
    tables[item_in] |= {"scenario.pid_frequencies.1": 3, "jitter.rms.2": 4}
    made, noted = object.__new__(reader._DefinitionReader), []
    made.fixed, made.grid, made.inputs = (tables[name] for name in order[:3])
    made.table = SimpleNamespace(optimise=SimpleNamespace(variables=tables["optimise.variables"]))
    made.reader = SimpleNamespace(fault=lambda *told: noted.append(told))
    made._check_doubles()
    may = list_in in ("set", "grid") and order.index(list_in) < order.index(item_in)
    assert noted == [] if may else noted == [
        (
            f"{item_in}.jitter.rms.2", None, f"is an item of jitter.rms, which stands in [{list_in}] as a whole",
            "the list, or its items, in one of the two tables",
        )
    ]  # fmt: skip


def test_a_mirror_may_be_drawn_beside_its_grid_or_its_own_parameters_and_nothing_else_twice():
    made = object.__new__(reader._DefinitionReader)
    made.fixed, made.grid = {"mirror.bias": 1}, {"mirror": ["a.toml", "b.toml"], "mirror.travel": 2}
    made.inputs, made.table = {"mirror": 3, "mirror.bias": 4}, None

    def told():
        noted = []
        made.reader = SimpleNamespace(fault=lambda key, *of: noted.append((key, of[1])))
        made._check_doubles()
        return noted

    assert told() == [("inputs.mirror.bias", "stands in [set] too")]
    made.fixed = {"mirror": "c.toml"}
    assert told() == [("grid.mirror", "stands in [set] too")]


def test_the_middle_of_an_input_is_that_of_its_own_distribution_whatever_it_is_drawn_as(tmp_path):
    power = POWER + DRAWN_AS.format("normal", 'mean = "7 W"\ndeviation = "0.3 W"')
    loss = distributed("communication.implementation_loss", 'distribution = "uniform"\nlow = "1 dB"\nhigh = "2 dB"')
    grid = '[grid]\n"terminals.leo_aperture" = ["5 cm", "6 cm"]\n'
    campaign, document = read_definition(written(tmp_path, HEAD + power + loss + grid))
    found = campaign_file._medians(campaign, document)
    values = [(m.communication.transmit_power_w, m.terminals.leo_aperture_m) for m in (each.mission for each in found)]
    assert values == [(pytest.approx(5.0), pytest.approx(0.05)), (pytest.approx(5.0), pytest.approx(0.06))]
    assert {each.mission.communication.implementation_loss_db for each in found} == {1.5}
    assert document.faults == []
