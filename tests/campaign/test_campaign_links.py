"""Campaigns of links alone: on every file that `microrad budget` takes, with every quantity drawn from anything."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from day_files import ALONE, day_file, day_path
from link_files import FADING
from microrad import link
from microrad.campaign import bundle, run
from microrad.campaign.definition.distributions import OneOf, Uniform
from microrad.campaign.definition.keys import find, flat, put
from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.definition.records import Cell, Draw
from microrad.campaign.export import export_rows
from microrad.campaign.file import load_campaign
from microrad.campaign.ledger import Ledger
from microrad.campaign.records import CampaignError
from microrad.campaign.rows import evaluate
from microrad.campaign.rows.evaluator import Evaluator
from microrad.campaign.rows.missions import MissionBuilder
from microrad.campaign.rows.plan import planned
from microrad.campaign.statistics.summary import summarise_campaign
from microrad.core import kernels, lti, reads
from microrad.link import radial_error
from microrad.link import study as link_study
from microrad.link.beams import LitAperture
from microrad.link.pointing import outage as under_jitter
from microrad.link.pointing.outage import Exposure
from microrad.link.variation import LINK_TABLES
from microrad.loop.control import AxisController
from microrad.mission.fields import Several
from microrad.mission.file import either_file, load_link, load_mission, named_files, open_mission, with_values
from microrad.mission.toml import MissionError
from microrad.orbit import day as day_study
from optical_files import optical
from preset_files import NAMES as PRESETS
from preset_files import completed
from shipped import SHIPPED, without_fine_pointing

CROSSLINK = SHIPPED.parent.parent / "docs" / "gallery" / "crosslink.toml"
HEAD = 'mission = "{name}.toml"\nseed = 1\nruns = 4\nsampling = "random"\n'
LIMIT = '[limits.margin]\nleast = "1 dB"\n'
TABLES = (*LINK_TABLES, "jitter", "requirement", "beacon", "answer")
POWER = '[inputs."communication.transmit_power"]\ndistribution = "uniform"\nlow = "0.1 W"\nhigh = "0.3 W"\n'


def mission(folder, name):
    """A link file by its name, without what is not known of it left."""
    if name in PRESETS:
        return completed(folder, name).path
    text = CROSSLINK.read_text(encoding="utf-8")
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def loaded(folder, name, body, head=HEAD):
    path = folder / f"campaign-{name}.toml"
    path.write_text(head.format(name=name) + body, encoding="utf-8")
    return load_campaign(path)


def rows(campaign, count=4):
    """The first rows of a campaign, all of which have results."""
    chunk = Evaluator(campaign, {}).rows(0, range(count), lambda: None)
    assert chunk.failed == ()
    return chunk.columns


def faults(folder, name, body, head=HEAD):
    with pytest.raises(MissionError) as caught:
        loaded(folder, name, body, head)
    return caught.value.faults


# ------------------------------------------------------------------------------------------------------- which files
@pytest.mark.promise("campaigns-10")
@pytest.mark.parametrize("name", [*PRESETS, "gallery"])
def test_a_campaign_takes_what_a_budget_takes(tmp_path, name):
    own = load_link(mission(tmp_path, name)).mission
    campaign = loaded(tmp_path, name, POWER)
    columns = rows(campaign)
    assert ("beacon_margin" in columns, "answer_margin" in columns) == (own.beacon is not None, own.answer is not None)
    gained = 10.0 * np.log10(columns["communication.transmit_power"] / own.communication.transmit_power_w)
    np.testing.assert_allclose(columns["margin"] - gained, Exposure.stated(link.of(own)).margin_db, atol=1e-9)


def test_a_series_of_fades_goes_with_a_campaign_and_leaves_its_margins_alone(tmp_path):
    plain = rows(loaded(tmp_path, mission(tmp_path, "gallery").stem, POWER))
    faded(tmp_path)
    campaign = loaded(tmp_path, "faded", POWER)
    np.testing.assert_array_equal(rows(campaign)["margin"], plain["margin"])
    assert "fades.csv" in named_files(campaign.mission.mission)


def faded(folder, series=None):
    path = mission(folder, "faded")
    path.write_text(path.read_text(encoding="utf-8") + FADING, encoding="utf-8")
    powers = 1.0 + 0.5 * np.sin(np.arange(2000) / 40.0) if series is None else series
    np.savetxt(folder / "fades.csv", powers, header="power", comments="")


@pytest.mark.promise("campaigns-64")
def test_the_margin_under_fades_is_drawn_as_a_budget_has_it(tmp_path):
    faded(tmp_path)
    drawn = '[inputs."communication.fading.interleaver"]\ndistribution = "table"\nvalues = ["1 ms", "20 ms"]\n'
    campaign = loaded(tmp_path, "faded", POWER + drawn)
    assert "margin_under_fades" in campaign.keep
    required = campaign.mission.mission.requirement.margin_db
    (limit,) = (each for each in campaign.limits if each.output == "margin_under_fades")
    assert (limit.least, limit.most, limit.source) == (required, None, "requirement.margin")
    columns = rows(campaign)
    for row in range(4):
        values = {key: float(columns[key][row]) for key in columns if key.startswith("communication.")}
        file = MissionBuilder(campaign).mission(0, values)
        found = link_study.run_link_study(file).fading
        assert columns["margin_under_fades"][row] == found.margin_left_db
        assert found.margin_left_db < found.margin_db - 0.1
        assert found.span_s == values["communication.fading.interleaver"]


@pytest.mark.promise("campaigns-64")
def test_a_margin_under_fades_needs_a_series_that_can_be_used(tmp_path):
    mission(tmp_path, "gallery")
    keep = HEAD + 'keep = ["margin", "margin_under_fades"]\n'
    (found,) = faults(tmp_path, "gallery", POWER, keep)
    assert (found.key, found.reason) == ("keep", "needs the mission's table [communication.fading] with a series")
    assert "margin_under_fades" not in loaded(tmp_path, "gallery", POWER).keep
    faded(tmp_path, np.ones(20))
    (found,) = faults(tmp_path, "faded", POWER, keep)
    assert found.key == "keep"
    assert "fades.csv: the series has 20 samples; from 200" in found.reason
    (tmp_path / "fades.csv").unlink()
    (found,) = faults(tmp_path, "faded", POWER, keep)
    assert (found.key, found.reason) == ("mission", "is named by the mission and does not exist")


def test_what_links_alone_have_not_is_refused_once(tmp_path):
    mission(tmp_path, "tbird")
    loop = '[loop]\ncontroller = "PI"\n'
    (found,) = faults(tmp_path, "tbird", POWER + loop)
    assert (found.key, found.reason) == ("loop", "needs a mission with the table [fine_pointing]")
    keep = HEAD + 'keep = ["margin", "answer_margin"]\n'
    (found,) = faults(tmp_path, "tbird", POWER, keep)
    assert (found.key, found.reason) == ("keep", "needs the mission's table [answer]")
    (found,) = faults(tmp_path, "tbird", '[inputs.mirror]\ndistribution = "identified"\n')
    assert found.reason == "is to be identified, but the mission has no mirror, only its links"
    (found,) = faults(tmp_path, "tbird", POWER + '[set]\n"control.rate" = "1 kHz"\n')
    assert (found.key, found.reason) == ("set.control.rate", "is no key of the mission")


@pytest.mark.promise("campaigns-11")
def test_the_largest_rate_is_solved_for_once_for_each_cell(tmp_path):
    mission(tmp_path, "gallery")
    fixed = '[set]\n"communication.data_rate" = "largest"\n[grid]\n"communication.distance" = ["500 km", "1000 km"]\n'
    campaign = loaded(tmp_path, "gallery", POWER + fixed)
    evaluator = Evaluator(campaign, {})
    near, far = (evaluator.rows(cell, range(4), lambda: None).columns for cell in (0, 1))
    nominal = campaign.cells[0].file.mission
    gained = 10.0 * np.log10(near["communication.transmit_power"] / nominal.communication.transmit_power_w)
    np.testing.assert_allclose(near["margin"] - gained, nominal.requirement.margin_db, atol=1e-9)
    np.testing.assert_allclose(far["margin"], near["margin"], atol=1e-9)
    np.testing.assert_allclose(far["data_rate"] * 4.0, near["data_rate"])
    (found,) = faults(tmp_path, "gallery", POWER + fixed.replace("500 km", "1e9 km"))
    assert found.key == "set.communication.data_rate" and "dB are missing" in found.reason
    table = '[inputs."communication.data_rate"]\ndistribution = "table"\nvalues = ["largest", "1 Mbit/s"]\n'
    (found,) = faults(tmp_path, "gallery", table)
    assert found.reason == "has a word that is solved for"


# ---------------------------------------------------------------------------------------------------- every quantity
def drawable(path):
    """Each quantity of the links' tables that has a value: its key and its value in SI units."""
    data = open_mission(path).data
    for text, value in flat(data).items():
        key = find(text, data) if text.rpartition(".")[0] in TABLES else None
        if key is not None and isinstance(key.rule, Several):
            for place, item in enumerate(value, 1):
                yield find(f"{text}.{place}", data), key.rule.each.read(item)
        elif key is not None and key.numeric is not None:
            yield key, key.numeric.read(value)


def distributed(key, value, kind):
    """A distribution of a kind a little below a value, above one that is 0 or the least that there is."""
    low, high = (1e-9, 2e-9) if not value else (1.01 * value, 1.02 * value)
    if value and (key.numeric.least is None or 0.98 * value >= key.numeric.least):
        low, high = 0.98 * value, 0.99 * value

    def written(number):
        return f'"{number!r} {key.unit}"' if key.unit else repr(number)

    def table(**numbers):
        return "".join(f"{name} = {written(number)}\n" for name, number in numbers.items())

    normal = table(mean=(low + high) / 2.0, deviation=(high - low) / 20.0)
    drawn_as = f'[inputs."{key.text}".drawn_as]\ndistribution = "normal"\n{normal}'
    listed = f"values = [{written(low)}, {written(high)}]\n"
    body = {"normal": normal, "table": listed}.get(kind) or table(low=low, high=high)
    return f'[inputs."{key.text}"]\ndistribution = "{kind}"\n{body}{drawn_as if kind == "normal" else ""}'


KINDS = ("normal", "uniform", "log-uniform", "table")
FILES = [*PRESETS, "gallery"]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        pytest.param(name, kind, id=f"{name}-{kind}", marks=[] if (place + turn) % 4 == 0 else pytest.mark.endurance)
        for place, name in enumerate(FILES)
        for turn, kind in enumerate(KINDS)
    ],
)
def test_every_quantity_is_drawn_from_any_distribution_or_read_by_nothing(tmp_path, name, kind):
    """Here each file with one kind, and each kind with some; `make endurance` tries every one."""
    found = {key.text: distributed(key, value, kind) for key, value in drawable(mission(tmp_path, name))}
    refused = faults(tmp_path, name, "".join(found.values()) + LIMIT)
    assert {fault.reason.partition(" (")[0] for fault in refused} == {"is read by nothing that is kept"}
    for fault in refused:
        del found[fault.key.removeprefix("inputs.")]
    unread = {fault.key.removeprefix("inputs.") for fault in refused}
    assert unread <= {"communication.pointing_error", "jitter.bandwidth", "requirement.pointing_error"} | {
        "requirement.outage",
        "point_ahead.transverse_velocity",
        "point_ahead.error",
    }
    even = HEAD.replace("random", "latin-hypercube")  # both values of a table
    columns = rows(loaded(tmp_path, name, "".join(found.values()) + LIMIT, even), 16)
    assert all(np.ptp(columns[key]) > 0.0 for key in found)
    assert np.ptp(columns["margin"]) > 0.0 and len(found) >= 14


@pytest.mark.promise("campaigns-9")
def test_each_item_of_a_list_has_its_own_key(tmp_path):
    mission(tmp_path, "gallery")
    first = '[inputs."jitter.rms.1"]\ndistribution = "uniform"\nlow = "1 urad"\nhigh = "9 urad"\n'
    campaign = loaded(tmp_path, "gallery", first)
    drawn = MissionBuilder(campaign).mission(0, {"jitter.rms.1": 5e-6}).mission
    assert drawn.jitter.rms_rad == (5e-6, 6e-6) and drawn.jitter.bias_rad == (4e-6, 0.0)
    assert (campaign.inputs[0].key, campaign.inputs[0].unit) == ("jitter.rms.1", "rad")
    both = loaded(tmp_path, "gallery", first + '[set]\n"jitter.rms.2" = "2 urad"\n')
    assert both.mission.mission.jitter.rms_rad == (6e-6, 2e-6)
    (found,) = faults(tmp_path, "gallery", first.replace("rms.1", "rms.3"))
    assert (found.reason, found.expected) == ("is no item of jitter.rms, a list of 2", "jitter.rms.1 or jitter.rms.2")
    (found,) = faults(tmp_path, "gallery", '[grid]\n"jitter.rms.1" = ["1 urad", "1 m"]\n')
    assert (found.key, found.value) == ("grid.jitter.rms.1", '"1 m"')
    whole = '[inputs."jitter.rms"]\ndistribution = "table"\nvalues = [["1 urad", "1 urad"], ["2 urad", "1 urad"]]\n'
    assert np.ptp(rows(loaded(tmp_path, "gallery", whole), 4)["margin"]) > 0.0
    (found,) = faults(tmp_path, "gallery", whole + first)
    assert found.reason == "is an item of jitter.rms, which stands in [inputs] as a whole"


@pytest.mark.promise("campaigns-9", "campaigns-10")
def test_a_list_is_drawn_as_one_number_which_its_items_follow_in_proportion(tmp_path):
    """As in --solve, the number is the largest item; the drawn margin is that of the mission with both items."""
    path = mission(tmp_path, "gallery")
    text = path.read_text(encoding="utf-8").replace('rms = ["6 urad", "6 urad"]', 'rms = ["6 urad", "3 urad"]')
    path.write_text(text.replace('bias = ["4 urad", "0 urad"]', 'bias = ["4 urad", "-2 urad"]'), encoding="utf-8")
    both = '[inputs."jitter.rms"]\ndistribution = "uniform"\nlow = "1 urad"\nhigh = "9 urad"\n'
    campaign = loaded(tmp_path, "gallery", both)
    assert (campaign.inputs[0].key, campaign.inputs[0].unit) == ("jitter.rms", "rad")
    found = rows(campaign, 4)
    assert np.ptp(found["jitter.rms"]) > 1e-6
    for drawn_rad, margin_db in zip(found["jitter.rms"], found["margin"], strict=True):
        m = MissionBuilder(campaign).mission(0, {"jitter.rms": float(drawn_rad)}).mission
        assert m.jitter.rms_rad == (drawn_rad, drawn_rad / 2)
        assert margin_db == pytest.approx(under_jitter.margin_db(link.of(m)), abs=1e-12)
    (wrong,) = faults(tmp_path, "gallery", both.replace('"9 urad"', '"9 W"'))
    assert wrong.key == "inputs.jitter.rms.high"
    (signed,) = faults(tmp_path, "gallery", both.replace("rms", "bias"))
    assert signed.expected == "jitter.bias.1 and jitter.bias.2, each with its distribution"


# ------------------------------------------------------------------------------------------------ nothing done twice
def test_rows_that_share_their_jitter_and_their_beam_share_what_follows_from_them(tmp_path, monkeypatch):
    mission(tmp_path, "gallery")
    evaluated = []
    own, field = radial_error._probability_of, LitAperture._field
    monkeypatch.setattr(radial_error, "_probability_of", lambda *a, **k: evaluated.append(1) or own(*a, **k))
    rows(loaded(tmp_path, "gallery", POWER))
    first = len(evaluated)
    assert first > 4
    rows(loaded(tmp_path, "gallery", POWER))  # the same margins: nothing but the shares beyond them is asked again
    assert len(evaluated) - first == 2 * (4 + 1)
    asked = []
    monkeypatch.setattr(LitAperture, "_field", lambda self, error: asked.append(error.size) or field(self, error))
    lit = LitAperture(0.0401, 1.5e-6, 0.0, 0.0)
    assert lit.loss_db(lit.error_rad(20.0)) == pytest.approx(20.0)
    assert sum(asked) < 200  # of the 2001 errors within 40 half angles
    asked.clear()
    assert lit.loss_db(lit.error_rad(20.0)) == pytest.approx(20.0) and asked == [1]


# ------------------------------------------------------------------------------------------------------------ chunks
DRAWN = '[inputs."jitter.rms.1"]\ndistribution = "uniform"\nlow = "20 urad"\nhigh = "30 urad"\n'
EVEN = HEAD.replace("random", "latin-hypercube").replace("runs = 4", "runs = 64")


def begun(folder, book, monkeypatch, row_s, progress=lambda *_: None):
    """A campaign of 64 rows that are taken to last ``row_s`` each, run to its end."""
    loaded(folder, "gallery", DRAWN, EVEN)
    monkeypatch.setattr(run, "row_s", lambda _: row_s)
    run.run_campaign(folder / "campaign-gallery.toml", folder / book, run.Means(threads=1), progress)
    return folder / book


def content(book):
    """Rows of each chunk, the exported rows, and all that they say but for the pace."""
    with Ledger.open(book, write=False) as opened:
        sizes = [chunk.columns["row"].size for chunk in opened.chunks(0)]
        export_rows(opened, book.with_suffix(".csv"))
    said = replace(summarise_campaign(book), progress=None)
    return sizes, book.with_suffix(".csv").read_bytes(), reads.digest(said)


@pytest.mark.promise("campaigns-5")
def test_chunks_are_cut_to_what_a_row_costs(tmp_path):
    mission(tmp_path, "gallery")
    campaign = loaded(tmp_path, "gallery", DRAWN, EVEN.replace("64", "4096"))
    whole = planned(campaign)
    assert whole.is_timed and whole.chunk_rows == 1024
    sizes = {row_s: whole.timed_chunk(row_s) for row_s in (0.0, 1e-4, 0.01, 0.1, 0.9, 5.0)}
    assert sizes == {0.0: 1024, 1e-4: 1024, 0.01: 128, 0.1: 16, 0.9: 2, 5.0: 1}
    timed = planned(replace(campaign, chunk_rows=whole.timed_chunk(0.1)))
    assert timed.rows_of(3) == range(48, 64)
    precise = '[precision]\noutput = "margin"\nquantile = 0.1\nhalf_width = "1 dB"\nconfidence = 0.9\nat_most = 9999\n'
    campaign = loaded(tmp_path, "gallery", DRAWN + precise, EVEN.replace("64", "4096"))
    assert timed.rounds == whole.rounds


def test_a_row_costs_the_mean_of_some_without_the_first(tmp_path):
    mission(tmp_path, "gallery")
    campaign = loaded(tmp_path, "gallery", DRAWN + '[grid]\n"requirement.outage" = [0.01, 0.001]\n', EVEN)
    times = iter([7.0, 7.05, 7.1, 7.25, 9.0])  # at the end of the first row, and of each behind it
    assert run.row_s(campaign, lambda: next(times)) == pytest.approx(0.25 / 3)
    assert list(times) == [9.0]
    assert run.row_s(replace(campaign, rows=1), lambda: 7.0) == 0.0  # no more rows than there are


@pytest.mark.usefixtures("rows_here")
def test_results_are_the_same_bits_whatever_a_row_costs(tmp_path, monkeypatch):
    mission(tmp_path, "gallery")
    whole = content(begun(tmp_path, "whole.ledger", monkeypatch, 1e-6))
    parts = content(begun(tmp_path, "parts.ledger", monkeypatch, 0.2))
    assert whole[0] == [64] and parts[0] == [8] * 8
    assert parts[1:] == whole[1:]


@pytest.mark.usefixtures("rows_here")
def test_a_campaign_that_is_resumed_keeps_its_chunks(tmp_path, monkeypatch):
    mission(tmp_path, "gallery")

    def stop(done, total, what):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=r"^stopped; 8 rows are in"):
        begun(tmp_path, "stopped.ledger", monkeypatch, 0.2, stop)
    monkeypatch.setattr(run, "row_s", lambda _: 1e-6)
    run.resume_campaign(tmp_path / "stopped.ledger", run.Means(threads=1))
    whole = content(begun(tmp_path, "whole.ledger", monkeypatch, 1e-6))
    sizes, *rest = content(tmp_path / "stopped.ledger")
    assert sizes == [8] * 8 and tuple(rest) == whole[1:]


@pytest.mark.parametrize("rows", [0, -8, 3, 2.0, True, "8"])
def test_chunks_of_impossible_size_are_refused(tmp_path, rows):
    mission(tmp_path, "gallery")
    spec = bundle.packed(loaded(tmp_path, "gallery", DRAWN), ())
    assert bundle.opened(spec).campaign.chunk_rows is None
    with pytest.raises(CampaignError, match="which microrad never makes"):
        bundle.opened(json.dumps(json.loads(spec) | {"chunk_rows": rows}).encode())


@pytest.mark.parametrize(
    "change",
    [
        {"files": {"a\0b": ""}},
        {"files": {"../a": ""}},
        {"files": {"": ""}},
        {"files": {"a/..": ""}},
        {"campaign": "."},
        {"files": []},
        {"controllers": [{}]},
        {"files": {"a": 7}},
    ],
)
def test_a_bundle_of_a_stranger_is_refused(tmp_path, change):
    mission(tmp_path, "gallery")
    spec = bundle.packed(loaded(tmp_path, "gallery", DRAWN), ())
    with pytest.raises(CampaignError, match="never"):
        bundle.opened(json.dumps(json.loads(spec) | change).encode())
    for odd in (b"", b"7", b"{}", b"[" * 100_000):
        with pytest.raises(CampaignError, match="never"):
            bundle.opened(odd)


def test_a_bundle_of_other_code_is_opened_to_be_read_alone(tmp_path):
    mission(tmp_path, "gallery")
    data = json.loads(bundle.packed(loaded(tmp_path, "gallery", DRAWN), ()))
    other = json.dumps(data | {"code": "another"}).encode()
    with pytest.raises(CampaignError, match=f"runs other code than the campaign: {data['code']} here, another there"):
        bundle.opened(other)
    assert bundle.opened(other, any_code=True).campaign.rows == 4


@pytest.mark.parametrize(("distance", "failed"), [("1 m", True), ("100 km", False)])
def test_a_beacon_that_is_too_near_has_no_margin(tmp_path, distance, failed):
    text = SHIPPED.read_text(encoding="utf-8")
    (tmp_path / "near.toml").write_text(text, encoding="utf-8")
    keep = HEAD + 'keep = ["beacon_margin"]\n'
    drawn = '[inputs."beacon.receive_optics_loss"]\ndistribution = "uniform"\nlow = "1 dB"\nhigh = "2 dB"\n'
    body = f'{drawn}[set]\n"beacon.distance" = "{distance}"\n'
    found = Evaluator(loaded(tmp_path, "near", body, keep), {}).rows(0, range(4), lambda: None).failed
    told = "beacon: its budget has more light arrive than was sent: the terminals are too near for it"
    assert [each.reason for each in found] == [told] * (4 * failed)


SERIES = '[inputs."communication.fading.series"]\ndistribution = "table"\nvalues = ["fades.csv", "{other}"]\n'


def test_each_file_that_is_drawn_belongs_to_the_campaign(tmp_path):
    faded(tmp_path)
    body = SERIES.format(other="deeper.csv")
    (found,) = faults(tmp_path, "faded", body)
    assert (found.key, found.reason) == ("mission", "is named by the mission and does not exist")
    np.savetxt(tmp_path / "deeper.csv", 1.0 + 0.9 * np.sin(np.arange(2000) / 40.0), header="power", comments="")
    campaign = loaded(tmp_path, "faded", body)
    assert campaign.files[-2:] == (tmp_path / "fades.csv", tmp_path / "deeper.csv")
    opened = bundle.opened(bundle.packed(campaign, ()))
    assert sorted(set(rows(opened.campaign)["margin_under_fades"])) == sorted(set(rows(campaign)["margin_under_fades"]))
    with pytest.raises(CampaignError, match=f"depends on {tmp_path / 'deeper.csv'}, an absolute path that another"):
        bundle.packed(loaded(tmp_path, "faded", SERIES.format(other=tmp_path / "deeper.csv")), ())


@pytest.mark.promise("campaigns-17")
def test_a_row_of_the_day_has_what_that_day_delivers(tmp_path):
    """Volume and time in contact of each row are those of the mission's own day at its power."""
    key, stated = "communication.transmit_power", 'transmit_power = "5 W"'
    text = without_fine_pointing(SHIPPED.read_text(encoding="utf-8")).replace('duration = "24 h"', 'duration = "3 h"')
    assert text.count(stated) == 1
    (tmp_path / "whole.toml").write_text(text, encoding="utf-8")
    drawn = f'[inputs."{key}"]\ndistribution = "uniform"\nlow = "4 W"\nhigh = "6 W"\n'
    found = rows(loaded(tmp_path, "whole", drawn, HEAD + 'keep = ["volume", "contact_time"]\n'), 2)
    for power_w, volume_bit, contact_s in zip(*(found[name] for name in (key, "volume", "contact_time")), strict=True):
        own = load_link(tmp_path / "whole.toml", text=text.replace(stated, f'transmit_power = "{float(power_w)!r} W"'))
        relay = day_study.run_day_study(link_study.run_link_study(own)).relay
        assert (volume_bit, contact_s) == pytest.approx((relay.capacity_bit, relay.contact_s), rel=1e-12)
    assert found["volume"][0] != found["volume"][1] and found["contact_time"][0] > 3600.0


@pytest.mark.promise("campaigns-17", "day-53")
def test_a_row_has_what_the_optical_downlink_carries_at_its_clouds(tmp_path):
    """The availability of a station is drawn, a number or an item of the twelve, and the volume is that of the day."""
    names = "operations.optical.stations.tenerife.availability", "operations.optical.stations.kiruna.availability.3"
    day_path(tmp_path, ALONE, optical({"tenerife": 0.5, "kiruna": [0.5] * 12}))
    drawn = "".join(f'[inputs."{name}"]\ndistribution = "uniform"\nlow = 0.1\nhigh = 0.9\n' for name in names)
    found = rows(loaded(tmp_path, "day", drawn, HEAD + 'keep = ["optical_volume"]\n'), 3)
    (tmp_path / "own").mkdir()
    for one, other, volume_bit in zip(*(found[name] for name in (*names, "optical_volume")), strict=True):
        clouds = {"tenerife": float(one), "kiruna": [0.5, 0.5, float(other), *[0.5] * 9]}
        way = day_study.optical_alone(day_file(tmp_path / "own", ALONE, optical(clouds)))
        assert volume_bit == pytest.approx(way.capacity_bit, rel=1e-12)
    assert len(set(found["optical_volume"])) == 3


def test_an_optical_volume_needs_an_optical_downlink(tmp_path):
    text = without_fine_pointing(SHIPPED.read_text(encoding="utf-8"))
    (tmp_path / "whole.toml").write_text(text, encoding="utf-8")
    body = POWER.replace("0.1 W", "4 W").replace("0.3 W", "6 W")
    (found,) = faults(tmp_path, "whole", body, HEAD + 'keep = ["optical_volume"]\n')
    assert (found.key, found.reason) == ("keep", "needs the mission's table [operations.optical]")
    assert found.expected == "a mission with [operations.optical], or this output left out"
    assert loaded(tmp_path, "whole", body, HEAD + 'keep = ["volume"]\n').keep == ("volume",)


def test_rows_of_the_day_stand_in_small_chunks(tmp_path):
    mission(tmp_path, "gallery")
    campaign = loaded(tmp_path, "gallery", DRAWN, EVEN.replace("64", "4096"))
    for keep, rows, timed in ((("volume",), 8, False), (("margin", "volume"), 8, False), (("margin",), 1024, True)):
        plan = planned(replace(campaign, keep=keep))
        assert (plan.chunk_rows, plan.largest_chunk, plan.is_timed) == (rows, rows, timed)
    assert planned(replace(campaign, keep=("volume",), rows=4)).largest_chunk == 4


# ----------------------------------------------------------------------------------------- outputs of a row, one by one
class Told(dict):
    """Runs of a loop whose every number is another."""

    radial_rms_rad = 1.5e-6
    largest_rad = np.array([2.5e-6, 7.5e-6, 3.5e-6])

    def quantile_rad(self, probability):
        return 1e-6 * probability

    def beyond(self, radius_rad):
        return 1e3 * radius_rad

    def share(self, counter):
        return 10.0 + counter


def test_each_output_of_the_residual_is_its_own_number_of_the_runs():
    file = load_mission(SHIPPED)
    m, counters = file.mission, kernels
    wanted = {
        "residual_rms": 1.5e-6,
        "residual_quantile": 1e-6 * m.fine_pointing.quantile,
        "residual_largest": 7.5e-6,
        "beyond_share": 1e3 * m.requirement.pointing_error_rad,
        "lost_share": 10.0 + counters.COUNT_LOST,
        "saturated_share": 10.0 + counters.COUNT_SATURATED,
        "beyond_rate_share": 10.0 + counters.COUNT_CLAMPED,
        "outside_share": 10.0 + counters.COUNT_OUTSIDE,
    }
    assert len(set(wanted.values())) == len(wanted)
    assert evaluate.outputs(file, Told(), list(wanted)[::-1]) == pytest.approx(wanted)
    assert list(evaluate.outputs(file, Told(), list(wanted)[::-1])) == list(wanted)
    assert evaluate.outputs(file, Told(), ["outside_share"]) == {"outside_share": 10.0 + counters.COUNT_OUTSIDE}


def test_each_output_of_the_links_and_the_day_is_its_own_number(monkeypatch):
    file = load_mission(SHIPPED)
    under = SimpleNamespace(margin_db=1.25, short_of=lambda margin_db: 0.5 + margin_db / 100.0, outage_loss_db=2.25)
    monkeypatch.setattr(evaluate, "_exposure", lambda data, runs: under)
    monkeypatch.setattr(evaluate, "_margin_under_fades", lambda file, data: 3.25)
    monkeypatch.setattr(evaluate, "_rate", lambda data, loss_db: 1e6 * loss_db)
    monkeypatch.setattr(
        evaluate, "_beam_margin", lambda of: {"beacon": 4.25, "answer": 5.25}[of.name] + of.beam.wavelength_m
    )
    monkeypatch.setattr(evaluate, "_day", lambda file, of: SimpleNamespace(capacity_bit=6.25e9, contact_s=725.0))
    monkeypatch.setattr(evaluate, "_optical_bit", lambda file: 8.25e9)
    m = file.mission
    names = [name for name, output in OUTPUTS.items() if output.group != "residual"]
    assert evaluate.outputs(file, None, names) == {
        "margin": 1.25,
        "margin_under_fades": 3.25,
        "outage": 0.5,
        "short": 0.5 + m.requirement.margin_db / 100.0,
        "data_rate": 2.25e6,
        "beacon_margin": 4.25 + m.beacon.wavelength_m,
        "answer_margin": 5.25 + m.answer.wavelength_m,
        "volume": 6.25e9,
        "contact_time": 725.0,
        "optical_volume": 8.25e9,
    }


def test_a_share_of_the_time_beyond_a_bin_is_of_all_runs_together():
    runs = SimpleNamespace(histogram=np.array([[5, 1, 0, 2], [3, 0, 4, 1]]))
    np.testing.assert_allclose(evaluate.exceeded(runs), [1.0, 0.5, 7.0 / 16.0, 3.0 / 16.0], rtol=1e-15)


def test_a_rate_that_no_link_closes_is_none_and_more_light_than_was_sent_is_refused(monkeypatch):
    def refused(data, margin_db, loss_db):
        raise link.LinkError("no rate")

    data = SimpleNamespace(requirement=SimpleNamespace(margin_db=3.5))
    monkeypatch.setattr(link, "rate_at_loss", lambda data, margin_db, loss_db: 100.0 * margin_db + loss_db)
    assert evaluate._rate(data, 2.25) == 352.25
    monkeypatch.setattr(link, "rate_at_loss", refused)
    assert evaluate._rate(data, 2.25) == 0.0
    words = "its budget has more light arrive than was sent: the terminals are too near for it"
    monkeypatch.setattr(Exposure, "stated", lambda data: SimpleNamespace(possible=False))
    with pytest.raises(link.LinkError, match=f"^{words}$"):
        evaluate._exposure(data, None)
    monkeypatch.setattr(link, "beam_budget", lambda *given: SimpleNamespace(possible=False))
    beam = evaluate._Beam("answer", (object(),), None, None, {})
    with pytest.raises(link.LinkError, match=f"^answer: {words}$"):
        evaluate._beam_margin(beam)


# ------------------------------------------------------------------------------------------------ missions of rows
@pytest.fixture(scope="module")
def builder():
    """Of two cells of the shipped mission, whose second has another aperture; power, words and a list are drawn."""
    document = open_mission(SHIPPED)
    cells = []
    for aperture in ("5 cm", "62.5 mm"):
        data = put(document.data, "terminals.leo_aperture", aperture)
        cells.append(Cell({"terminals.leo_aperture": aperture}, data, either_file(with_values(document, data))))
    strehl = OneOf((1.0, 2.0), (0.5, 0.5), ("decibel", "ratio"), True)
    draws = (
        Draw("communication.transmit_power", "W", Uniform(1.0, 9.0), None),
        Draw("conventions.strehl", "", strehl, None),
    )
    return MissionBuilder(SimpleNamespace(cells=tuple(cells), draws=draws))


def test_a_row_of_the_second_cell_has_its_grid_and_its_draws_with_their_sources(builder):
    drawn = {"communication.transmit_power": 2.0625, "conventions.strehl": 1.0, "mirror.none": math.nan}
    file = builder.mission(1, drawn)
    m = file.mission
    assert (m.terminals.leo_aperture_m, m.communication.transmit_power_w, m.conventions.strehl) == (
        0.0625,
        2.0625,
        "decibel",
    )
    assert builder.mission(0, drawn).mission.terminals.leo_aperture_m == 0.05
    power, strehl = (file.sources[key] for key in ("communication.transmit_power", "conventions.strehl"))
    assert (power.line, power.comment, power.value, power.file) == (
        0,
        "campaign: drawn, 2.0625 W",
        "2.0625 W",
        "campaign file",
    )
    assert (strehl.comment, strehl.value) == ("campaign: drawn, decibel", "decibel")
    assert builder.mission(1, {}) is builder._cells[1].file
    frequencies = builder.mission(0, {"scenario.pid_frequencies": 22.5}).mission.scenario.pid_frequencies_hz
    assert frequencies == pytest.approx((1.5, 22.5))  # in proportion to the largest of 1 and 15 Hz
    assert builder.mission(0, {"scenario.pid_frequencies.1": 0.5}).mission.scenario.pid_frequencies_hz == (0.5, 15.0)


def test_a_row_that_is_no_mission_says_each_key_with_its_drawn_value(builder):
    with pytest.raises(CampaignError) as refused:
        builder.mission(1, {"communication.transmit_power": -2.0625, "terminals.geo_aperture": 2e3})
    assert str(refused.value) == (
        'the row is no mission: terminals.geo_aperture = "2000.0 m" is above 100 m; communication.transmit_power = '
        '"-2.0625 W" is not above 0 W'
    )


def test_the_loop_of_a_row_is_told_by_what_it_depends_on_alone(builder):
    values = {"communication.transmit_power": 2.0, "fine_pointing.optical_sensor.noise": 1e-6, "mirror.travel": 0.25}
    key = (("fine_pointing.optical_sensor.noise", 1e-6), ("mirror.travel", 0.25))
    assert builder.loop_key(0, values) == builder.loop_key(1, values) == key


# ------------------------------------------------------------------------------------------------------- in one piece
def test_a_file_of_a_bundle_lies_within_its_folder_and_no_other_does(tmp_path):
    assert bundle._inside(tmp_path, "a/../b/c.toml") == tmp_path / "b" / "c.toml"
    for name in ("../c.toml", "a/../..", ".", "", "/c.toml", "a\0b"):
        with pytest.raises(CampaignError) as refused:
            bundle._inside(tmp_path, name)
        assert (
            str(refused.value) == f"the ledger holds a file {name!r}, which microrad never puts there: leave it alone"
        )


def test_files_are_named_from_the_nearest_folder_that_holds_them_all(tmp_path):
    files = [tmp_path / "a" / "c.toml", tmp_path / "a" / ".." / "b" / "m.toml", tmp_path / "a" / "d" / "x.toml"]
    assert bundle._named(files) == dict(zip(("a/c.toml", "b/m.toml", "a/d/x.toml"), files, strict=True))
    assert bundle._named(files[:1]) == {"c.toml": files[0]}


def test_a_controller_of_unlike_matrices_comes_back_from_a_bundle():
    A, B, C, D = np.array([[1.5, 2.0], [3.0, 4.0]]), np.array([[5.0], [6.0]]), np.array([[7.0, 8.0]]), np.array([[0.1]])
    given = AxisController("PI", lti.StateSpace(A, B, C, D), np.array([[9.0], [1e-17]]))
    found = bundle._read_controller(json.loads(json.dumps(bundle._written_controller(given))))
    assert found.name == "PI"
    for ours, theirs in zip(
        (A, B, C, D, given.anti_windup), (*(getattr(found.system, n) for n in "ABCD"), found.anti_windup), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)


def test_the_files_of_a_campaign_tell_it_apart_by_their_names_and_bytes_but_for_its_own(tmp_path):
    for name in ("c.toml", "m.toml", "x.toml"):
        (tmp_path / name).write_text(name)
    campaign = SimpleNamespace(path=tmp_path / "c.toml", files=tuple(tmp_path / f"{name}.toml" for name in "cmx"))

    def now():
        return bundle.mission_sha256(campaign)

    first = now()
    (tmp_path / "c.toml").write_text("other")
    assert now() == first
    (tmp_path / "x.toml").write_text("other")
    assert now() != first
    (tmp_path / "x.toml").write_text("x.toml")
    assert now() == first
    (tmp_path / "y.toml").write_text("x.toml")
    campaign.files = (*campaign.files[:2], tmp_path / "y.toml")
    assert now() != first


@pytest.mark.parametrize(
    ("drawn", "words"),
    [
        ({"mirror.bias": 900.0}, "mirror.bias = 900.0 V is outside drive_min to drive_max (0 V to 12 V)"),
        (
            {"amplifier.output_max": 12.5, "amplifier.gain": 62.5},
            "mirror.bias = ? is outside amplifier.output_min to amplifier.output_max divided by amplifier.gain",
        ),
    ],
)
def test_what_does_not_fit_in_a_row_is_told_with_its_drawn_value_where_it_has_one(builder, drawn, words):
    with pytest.raises(CampaignError) as refused:
        builder.mission(0, drawn)
    assert str(refused.value) == f"the row is no mission: {words}"


def test_each_series_of_a_grid_has_to_be_one_that_can_be_used(tmp_path):
    """The second of two is too short."""
    faded(tmp_path)
    np.savetxt(tmp_path / "short.csv", np.ones(20), header="power", comments="")
    keep = HEAD + 'keep = ["margin", "margin_under_fades"]\n'
    grid = '[grid]\n"communication.fading.series" = ["fades.csv", "{}"]\n'
    (found,) = faults(tmp_path, "faded", POWER + grid.format("short.csv"), keep)
    assert (found.key, found.expected) == ("keep", "a series that can be used, or this output left out")
    assert found.reason.startswith("needs communication.fading: ")
    assert "short.csv: the series has 20 samples; from 200" in found.reason
    (found,) = faults(tmp_path, "faded", POWER + grid.format("none.csv"), keep)
    assert (found.key, found.reason) == ("mission", "is named by the mission and does not exist")
    assert "none.csv" in found.value


def test_a_list_that_is_drawn_as_one_number_has_the_proportions_of_its_own_cell(builder):
    """Cells of unlike lists, asked in turn; an item by itself leaves the others of its cell."""
    key = "scenario.pid_frequencies"
    first, second = builder._cells
    other = replace(second, data=put(second.data, key, ["2 Hz", "4 Hz", "8 Hz"]))
    made = MissionBuilder(SimpleNamespace(cells=(first, other), draws=()))
    for cell, largest, found in ((0, 22.5, (1.5, 22.5)), (1, 16.0, (4.0, 8.0, 16.0)), (0, 7.5, (0.5, 7.5))):
        assert made.mission(cell, {key: largest}).mission.scenario.pid_frequencies_hz == pytest.approx(found)
    drawn = {f"{key}.1": 3.0, f"{key}.2": 5.0}
    assert made.mission(1, drawn).mission.scenario.pid_frequencies_hz == (3.0, 5.0, 8.0)
    assert made.mission(0, drawn).mission.scenario.pid_frequencies_hz == (3.0, 5.0)


def test_the_order_of_its_files_does_not_tell_a_campaign_apart_and_what_name_has_which_bytes_does(tmp_path):
    names = ("c.toml", "a.toml", "b.toml")
    for name in names:
        (tmp_path / name).write_text(f"of {name}", encoding="utf-8")
    files = [tmp_path / name for name in names]

    def told(*order):
        return bundle.mission_sha256(SimpleNamespace(path=files[0], files=tuple(files[k] for k in order)))

    first = told(0, 1, 2)
    assert first == told(2, 0, 1) == told(1, 2, 0) != told(0, 1)
    files[1].write_text("of b.toml", encoding="utf-8")
    files[2].write_text("of a.toml", encoding="utf-8")
    assert told(0, 1, 2) != first


def test_a_bundle_that_cannot_be_read_leaves_no_folder_and_one_that_can_until_it_goes(tmp_path, monkeypatch):
    mission(tmp_path, "gallery")
    made = iter(tmp_path / f"opened {number}" for number in range(3))

    def scratch(name):
        folder = next(made)
        folder.mkdir()
        return folder

    monkeypatch.setattr(bundle, "scratch_folder", scratch)
    spec = json.loads(bundle.packed(replace(loaded(tmp_path, "gallery", DRAWN), chunk_rows=2), ()))
    found = bundle.opened(json.dumps(spec).encode())
    assert {each.name for each in (tmp_path / "opened 0").iterdir()} == spec["files"].keys()
    assert (found.campaign.chunk_rows, found.campaign.path) == (2, tmp_path / "opened 0" / spec["campaign"])
    del found
    assert not (tmp_path / "opened 0").exists()
    (other,) = spec["files"].keys() - {spec["campaign"]}
    for files in ({name: data for name, data in spec["files"].items() if name != other}, {"../x": "", **spec["files"]}):
        with pytest.raises((MissionError, CampaignError)):
            bundle.opened(json.dumps(spec | {"files": files}).encode())
    assert not list(tmp_path.glob("opened*"))


def test_a_bundle_keeps_its_files_apart_in_the_folders_that_they_come_from(tmp_path):
    """Two files of one name, one of them two new folders deep."""
    there, here = tmp_path / "missions" / "links", tmp_path / "runs"
    for folder in (there, here):
        folder.mkdir(parents=True)
    own = mission(there, "gallery").rename(there / "campaign.toml")
    (here / "campaign.toml").write_text(HEAD.format(name="../missions/links/campaign") + DRAWN, encoding="utf-8")
    campaign = load_campaign(here / "campaign.toml")
    spec = bundle.packed(campaign, ())
    assert json.loads(spec)["campaign"] == "runs/campaign.toml"
    assert json.loads(spec)["files"].keys() == {"runs/campaign.toml", "missions/links/campaign.toml"}
    opened = bundle.opened(spec)
    found = opened.campaign
    assert (found.path.parent.name, found.sha256) == ("runs", campaign.sha256)
    assert found.mission.path.read_bytes() == own.read_bytes()
    assert bundle.mission_sha256(found) == bundle.mission_sha256(campaign)


@pytest.mark.parametrize(
    ("error", "ours"),
    [(AttributeError, True), (KeyError, True), (IndexError, True), (RecursionError, True), (TypeError, True),
     (ValueError, True), (MemoryError, False), (OSError, False), (KeyboardInterrupt, False)],
)  # fmt: skip
def test_a_bundle_that_is_none_of_ours_is_told_whatever_it_raises(monkeypatch, error, ours):
    raised = error("odd")

    def broken(spec):
        raise raised

    monkeypatch.setattr(bundle, "json", SimpleNamespace(loads=broken))
    with pytest.raises(CampaignError if ours else error) as told:
        bundle._unpacked(b"{}")
    if ours:
        assert str(told.value) == "the ledger holds a campaign as microrad never writes it: leave it alone"
        assert told.value.__cause__ is raised
