"""The commands of the day: contacts and constellation in each of their forms, and what each refuses, in words."""

import csv
import io
import json
import re
from types import SimpleNamespace

import pytest

from command_line import listing
from day_files import ALONE, BY_FILE, HELD, LIMITS, day_data, day_path, element_set
from link_files import written
from microrad.link import study as link_study
from microrad.mission.file import load_link
from microrad.orbit import constellation as plans
from microrad.orbit import day as day_study
from microrad.orbit.operations import COLUMNS
from report_pages import assert_sound, without_scripts
from shared import found_once

QUICK = {"orbit.duration": "6 h", "operations.runs": 3}
BLIND = {LIMITS: {**HELD, "boresight": [0.0, 0.0, 1.0], "field_of_regard": "5 deg"}}  # at the Earth
DEAF = {"operations.downlink.stations.kiruna.mask": "88 deg"}
NO_DOWNLINK = {"operations.downlink": None, "operations.contact": None}
ALWAYS = {"orbit.leo": {"kind": "geostationary", "longitude": "100 deg"}, "orbit.geo.limits": None, **ALONE}
NO_NUMBER = re.compile(r"\b(nan|inf|NaN|Infinity|None)\b")
MISSIONS = {
    "plain": {},
    "no contact": BLIND,
    "nothing direct": DEAF,
    "nothing at all": {**BLIND, **DEAF},
    "no downlink": NO_DOWNLINK,
    "no acquisition": {"acquisition": None},
    "always in view": ALWAYS,
    "a share": {"operations.relay_share": 0.5},
}
SAID_ELSEWHERE = ("nothing direct", "nothing at all")
"""Two of the others at once, and what `test_where_nothing_goes_direct…` has in its own words."""
ONCE = (
    (link_study, "run_link_study", found_once(link_study.run_link_study)),
    (day_study, "run_day_study", found_once(day_study.run_day_study, lambda links: links.file)),
    (plans, "run_constellation", found_once(plans.run_constellation)),
)


@pytest.fixture(autouse=True)
def once(monkeypatch):
    """Each mission is studied once: these tests read what is said of it, in several forms."""
    for module, name, found in ONCE:
        monkeypatch.setattr(module, name, found)


@pytest.fixture
def unchanged(monkeypatch):
    """A day of which no assumption is changed, which takes most of its time; its mission is that of no other test."""
    monkeypatch.setattr(day_study, "swings", lambda *args: ())


def path_of(folder, *changes):
    return day_path(folder, QUICK, *changes)


def words_of(page):
    """What a reader of a page sees, without its figures."""
    page = re.sub(r"<svg.*?</svg>|<style.*?</style>|<script.*?</script>", " ", page, flags=re.DOTALL)
    return " ".join(re.sub(r"<[^>]+>", " ", page).split())


# ------------------------------------------------------------------------------------------------------------ contacts
@pytest.mark.promise("day-1", "day-3", "day-4", "day-5")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.endurance] * (name in SAID_ELSEWHERE)) for name in MISSIONS]
)
def test_contacts_in_words_without_a_number_that_is_none(call, folder, name):
    result = call("contacts", path_of(folder, MISSIONS[name]))
    assert (result.code, result.err) == (1 if name in ("no contact", "nothing at all") else 0, "")
    titles = ("What the link delivers", "Relay and direct downlink", "Contacts", "One assumption changed")
    assert [line for line in result.out.splitlines() if line in titles] == list(titles)
    assert not NO_NUMBER.search(result.out)
    assert max(map(len, result.out.splitlines())) <= 80
    said = " ".join(result.out[result.out.index("In 6 h") :].split())
    assert ("There is no contact: within the span" in said) == (result.code == 1)
    assert ("grants the link" in said) == (name == "a share")
    assert ("at every range of the contacts" in said) is False or name == "always in view"
    assert ("at a time (median)" in said) == (name not in ("no contact", "nothing at all", "always in view"))


@pytest.mark.promise("readme-5")
@pytest.mark.promise("day-1", "day-5")
@pytest.mark.promise("readme-23")
def test_the_words_of_a_day(call, folder):
    said = call("contacts", path_of(folder)).out
    data = json.loads(call("contacts", path_of(folder), "--json").out)
    relay, direct = data["relay"], data["direct"]
    said = " ".join(said.split())
    head = f"In 6 h the relay is in view {relay['contacts']} times, {relay['contact_s'] / 60:.0f} min in all"
    assert head in said
    volume, a_day = (f"{n * relay['could_carry_bit'] / 8e9:.3g}" for n in (1, 4))
    assert re.search(rf"could carry {volume} GB( \({float(a_day) / 1e3:.3g} TB a day\))?\. The ground", said)
    heard = f"in view {direct['contacts']} times" if direct["contacts"] else "never in view"
    assert f"The ground (kiruna) is {heard}, " in said
    assert f"in view for {100 * data['visible_share']:.1f} % of the time" in said
    assert "Over the equator a contact would take 56.72 min" in said
    assert "Warnings: - communication.distance is 42000 km" in said
    for sentence in data["verdict"]:
        assert sentence in said


def test_words_of_a_share_keep_the_view_apart_from_what_is_granted(call, folder):
    whole, half = (call("contacts", path_of(folder, each)).out for each in ({}, MISSIONS["a share"]))
    view = re.compile(r"The relay is in view for .*? at most\.", re.DOTALL)
    assert view.search(whole).group() == view.search(half).group()


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-3")
@pytest.mark.usefixtures("unchanged")
def test_contacts_as_csv(call, folder):
    result = call("contacts", path_of(folder, {"orbit.duration": "12 h"}), "--csv")
    assert (result.code, result.err) == (0, "")
    rows = list(csv.DictReader(io.StringIO(result.out)))
    data = json.loads(call("contacts", path_of(folder, {"orbit.duration": "12 h"}), "--json").out)
    assert {row["by"] for row in rows} == {"relay", "direct downlink"}
    starts = [float(row["rise (s)"]) for row in rows]
    assert starts == sorted(starts)
    relay = [row for row in rows if row["by"] == "relay"]
    assert len(relay) == len(data["contacts"])
    for row, each in zip(relay, data["contacts"], strict=True):
        assert (row["rise (UTC)"], row["ends by"]) == (each["start_utc"], each["ends"])
        assert float(row["largest range (m)"]) == each["range_most_m"]
        assert float(row["largest Doppler shift (Hz)"]) == each["doppler_most_hz"]
        assert float(row["could carry (bit)"]) == each["could_carry_bit"]
    direct = [row for row in rows if row["by"] != "relay"]
    assert {row["with"] for row in direct} == {"kiruna"}
    assert {row["largest range (m)"] for row in direct} == {""}


def finite(data):
    """Every number of a document."""
    if isinstance(data, dict):
        return [x for value in data.values() for x in finite(value)]
    if isinstance(data, list):
        return [x for value in data for x in finite(value)]
    return [data] if isinstance(data, float) else []


def no_constant(text):
    raise AssertionError(text)


@pytest.mark.promise("day-3")
@pytest.mark.parametrize("name", ["plain", "nothing at all", "no downlink", "always in view"])
def test_contacts_as_json(call, folder, name):
    result = call("contacts", path_of(folder, MISSIONS[name]), "--json")
    data = json.loads(result.out, parse_constant=no_constant)
    assert result.err == ""
    assert finite(data)
    assert (data["epoch"], data["duration_s"]) == ("2026-03-20T12:00:00Z", 21600.0)
    assert len(data["contacts"]) == data["relay"]["contacts"]
    assert sum(c["could_carry_bit"] for c in data["contacts"]) == pytest.approx(data["relay"]["could_carry_bit"])
    assert (data["direct"] is None) == (name == "no downlink")
    assert (data["median_contact_s"] is None) == (name in ("nothing at all", "always in view"))
    assert (data["closed_form_contact_s"] is None) == (name in ("nothing at all", "always in view"))
    if name == "plain":
        assert data["relay"]["could_carry_least_bit"] <= data["relay"]["could_carry_most_bit"]
        factors = [each["factor"] for each in data["assumptions"]]
        assert factors[0] is None  # infinite: at twice the rate nothing flows
        known = [factor for factor in factors if factor is not None]
        assert factors[-len(known) :] == known == sorted(known, reverse=True)


@pytest.mark.promise("report-12")
@pytest.mark.promise("day-3")
@pytest.mark.parametrize("name", ["plain", "nothing at all"])
def test_contacts_as_a_page_that_loads_nothing(call, folder, name):
    result = call("contacts", path_of(folder, MISSIONS[name]), "--html")
    assert (result.code, result.err) == (int(name != "plain"), "")
    assert_sound(result.out)
    page = without_scripts(result.out)
    assert page.lstrip().lower().startswith("<!doctype html>")
    for load in re.findall(r"""(?:src|href|xlink:href|action|data)\s*=\s*["']([^"']*)""", page):
        assert load.startswith("#"), load
    assert not re.findall(r"url\((?!\s*[\"']?#)[^)]*\)|@import|<script[^>]*src|<link\b|<iframe", page)
    assert page.count("<svg") >= 5
    words = words_of(page)
    assert not NO_NUMBER.search(words)
    assert f"In 6 h the relay is {'in view' if name == 'plain' else 'never in view'}" in words
    assert listing(folder).keys() == {"day.toml"}


@pytest.mark.usefixtures("unchanged")
def test_a_name_is_no_markup(call, folder):
    path = path_of(folder, {"terminals.geo_name": "<b>&G"})
    page = call("contacts", path, "--html").out
    assert "<b>&G" not in page
    assert page.count("&lt;b&gt;&amp;G") > 5
    assert ",'=GEO," in call("contacts", path_of(folder, {"terminals.geo_name": "=GEO"}), "--csv").out


# ------------------------------------------------------------------------------------------------------- constellation
@pytest.mark.promise("readme-5")
@pytest.mark.promise("day-3")
@pytest.mark.promise("readme-23")
def test_a_constellation_in_words(call, folder):
    result = call("constellation", path_of(folder))
    assert (result.code, result.err) == (0, "")
    assert "What each satellite gets" in result.out
    assert "12 satellites share 2 relays of one terminal each: in 6 h" in result.out
    assert not NO_NUMBER.search(result.out)


@pytest.mark.promise("gallery-23", "readme-8")
@pytest.mark.promise("day-3", "day-34")
def test_a_constellation_as_csv_plan_and_json(call, folder):
    path = path_of(folder)
    rows = list(csv.DictReader(io.StringIO(call("constellation", path, "--csv").out)))
    data = json.loads(call("constellation", path, "--json").out, parse_constant=no_constant)
    plan = call("constellation", path, "--contact-plan").out.splitlines()
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == data["sessions"]
    assert sum(float(row["volume (bit)"]) for row in rows) == pytest.approx(data["volume_bit"])
    assert {row["relay"] for row in rows} == {relay["name"] for relay in data["relays"]} == {"east", "west"}
    assert {row["satellite"] for row in rows} == {one["name"] for one in data["satellites"]}
    with_data = [row for row in rows if float(row["rate (bit/s)"]) > 0.0]
    assert len([line for line in plan if line.startswith("a contact ")]) == len(with_data)
    assert "@ 2026/03/20-12:00:00" in plan


@pytest.mark.promise("day-4")
def test_a_constellation_that_carries_nothing_is_exit_code_1(call, folder):
    for form in ((), ("--csv",), ("--json",), ("--contact-plan",)):
        result = call("constellation", path_of(folder, BLIND), *form)
        assert (result.code, result.err) == (1, "")
        assert not NO_NUMBER.search(result.out)
    assert call("constellation", path_of(folder, BLIND), "--csv").out == ",".join(COLUMNS) + "\n"


def test_a_constellation_of_a_file(call, folder):
    (folder / "a.tle").write_text(element_set() + element_set(name="EXAMPLE 2", number="70002"), encoding="utf-8")
    result = call("constellation", path_of(folder, {"constellation": BY_FILE}))
    assert result.code == 0
    assert "EXAMPLE 1" in result.out
    assert "2 satellites share 1 relay of one terminal: in" in result.out


# ------------------------------------------------------------------------------------------------------------ refusals
@pytest.mark.parametrize(
    ("command", "flags"),
    [
        ("contacts", ("--csv", "--json")),
        ("contacts", ("--html", "--csv")),
        ("contacts", ("--html", "--csv", "--json")),
        ("constellation", ("--csv", "--contact-plan")),
        ("constellation", ("--json", "--contact-plan")),
    ],
)
def test_forms_exclude_each_other(refused, folder, command, flags):
    said = refused(command, path_of(folder), *flags)
    assert "exclude each other; give one of them." in said


@pytest.mark.promise("day-4")
@pytest.mark.parametrize(
    ("command", "changes", "words"),
    [
        ("contacts", {"orbit.geo.longitude": None}, ("orbit.geo.longitude", 'kind = "geostationary" needs it')),
        ("contacts", {"operations.downlink.stations.kiruna.mask": "95 deg"}, ('mask = "95 deg"', "is above")),
        ("contacts", {"orbit.epoch": "2026-02-30T12:00:00Z"}, ("is no date", "expected:")),
        ("contacts", {"orbit.leo.altitude": "110 km"}, ("day.toml: orbit.leo:", "it has decayed", "raise")),
        ("contacts", {"orbit.epoch": "1950-01-01T00:00:00Z"}, ("day.toml: orbit.epoch:", "take an instant")),
        ("contacts", {"orbit.leo": {"kind": "elements", "file": "a.tle"}, **ALONE}, ("a.tle", "no such file")),
        ("contacts", {"orbit": None, "operations": None, **ALONE}, ("no table [orbit]", "microrad init writes one")),
        ("contacts", {"operations": None, **ALONE}, ("no table [operations]", "microrad init writes one")),
        ("constellation", ALONE, ("no table [constellation]", "microrad init writes one")),
        ("constellation", {"operations": None}, ("stands without the table operations", "microrad init writes")),
        ("constellation", {"constellation.planes": 5}, ("planes = 5", "does not divide satellites = 12")),
        ("constellation", {"constellation": BY_FILE}, ("a.tle", "no such file")),
    ],
)
def test_what_does_not_hold_is_refused_in_words(refused, folder, command, changes, words):
    said = refused(command, day_path(folder, QUICK, changes))
    for word in words:
        assert word in said, said


@pytest.mark.promise("day-4")
def test_expired_elements_are_refused_by_both_commands(refused, folder):
    (folder / "a.tle").write_text(element_set(day=20.0), encoding="utf-8")
    leo = {"orbit.leo": {"kind": "elements", "file": "a.tle"}, **ALONE}
    assert "the elements are expired" in refused("contacts", path_of(folder, leo))
    assert "the elements are expired" in refused("constellation", path_of(folder, {"constellation": BY_FILE}))


@pytest.mark.promise("day-4")
def test_a_file_that_is_not_there(refused, folder):
    for command in ("contacts", "constellation"):
        assert "nowhere.toml" in refused(command, "nowhere.toml")
    path = folder / "broken.toml"
    path.write_text("[orbit\n", encoding="utf-8")
    assert "broken.toml" in refused("contacts", path)


def test_a_rate_that_the_receiver_does_not_take_is_refused(refused, folder):
    path = path_of(folder, {"communication.data_rate": "5 Gbit/s"})
    data = day_data(QUICK, {"communication.data_rate": "5 Gbit/s"})
    del data["communication"]["receiver_sensitivity"]
    receiver = {"modulation": "bpsk", "detector": "homodyne", "efficiency": 0.7, "bit_error_ratio": 1e-6}
    data["communication"]["receiver"] = {**receiver, "code_gain": "5 dB", "code_rate": 0.8, "bandwidth": "1 GHz"}
    written(path.parent, data, path.name)
    assert "5 Gbit/s" in refused("contacts", path)


@pytest.mark.usefixtures("unchanged")
def test_rates_that_the_receiver_does_not_take_are_left_out(call, folder):
    receiver = {"modulation": "bpsk", "detector": "homodyne", "efficiency": 0.7, "bit_error_ratio": 1e-6}
    receiver = {**receiver, "code_gain": "5 dB", "code_rate": 0.8, "bandwidth": "1 GHz"}
    given = {"communication.receiver_sensitivity": None, "communication.receiver": receiver}
    fast = {"operations.rates": ["20 Gbit/s", "30 Gbit/s"]}
    result = call("contacts", path_of(folder, given, fast))
    assert result.code == 1
    assert "The receiver takes none of the mission's data rates." in result.out
    slow = {"operations.rates": ["10 Mbit/s", "30 Gbit/s"]}
    data = json.loads(call("contacts", path_of(folder, given, slow), "--json").out)
    assert [rate["rate_bit_s"] for rate in data["rates"]] == [10e6]


def test_help_lists_both_commands(call, folder):
    said = call("--help").out
    assert re.search(r"^ *contacts +Print when the link has contact", said, flags=re.MULTILINE)
    assert re.search(r"^ *constellation +Plan who is served when", said, flags=re.MULTILINE)
    for command, flags in (("contacts", ("--csv", "--html", "--json")), ("constellation", ("--csv", "--contact-plan"))):
        text = call(command, "--help").out
        assert f"microrad {command} leo-geo.toml" in text
        for flag in flags:
            assert flag in text


@pytest.mark.promise("day-1")
def test_the_loss_is_the_jitters_where_the_mission_has_one(call, folder, monkeypatch):
    jitter = {"jitter": {"bias": ["1 urad", "0 urad"], "rms": ["3 urad", "3 urad"], "bandwidth": "50 Hz"}}
    path = path_of(folder, jitter)
    with monkeypatch.context() as patch:
        patch.setattr(day_study, "swings", lambda *args: ())  # as of `unchanged`
        data = json.loads(call("contacts", path, "--json").out)
    found = link_study.run_link_study(load_link(path)).under_jitter
    assert (data["pointing_loss_db"], data["outage"]) == (found.outage_loss_db, found.outage)
    assert data["pointing_loss_source"] == "jitter as given"
    plain = json.loads(call("contacts", path_of(folder), "--json").out)
    assert plain["pointing_loss_source"].startswith("communication.pointing_error, 10 ")
    # the loss of the budget itself: a Gaussian beam 10 urad off its axis
    assert plain["pointing_loss_db"] == pytest.approx(2.23, abs=0.01)


def test_where_nothing_goes_direct_the_relays_volume_is_what_matters(call, folder):
    said = " ".join(call("contacts", path_of(folder, {"operations.downlink.setup": "1 h"})).out.split())
    assert "could carry 0 B" in said
    assert (
        "What matters most to the relay's volume, each assumption changed alone: laser data rate (150 Mbit/s:" in said
    )
    assert "nothing direct" not in said
    assert "by the direct downlink nothing arrives" in said


@pytest.mark.parametrize("bit", [0.0, 2.5e9])
@pytest.mark.parametrize(("flag", "text"), [((), "text\n"), (("--csv",), "csv\n"), (("--html",), "page\n")])
def test_a_day_in_any_form_is_exit_0_where_the_relay_carries_something(call, folder, monkeypatch, bit, flag, text):
    day = SimpleNamespace(relay=SimpleNamespace(capacity_bit=bit), direct=SimpleNamespace(capacity_bit=1e9 - bit))
    monkeypatch.setattr(day_study, "run_day_study", lambda links, on_progress: day)
    monkeypatch.setattr("microrad.report.day.data.day_csv", lambda found: "csv")
    monkeypatch.setattr("microrad.report.day.page.day_page", lambda found, links: "page")
    monkeypatch.setattr("microrad.report.day.page.day_text", lambda found, width, sources: "text")
    result = call("contacts", path_of(folder), *flag)
    assert (result.code, result.out) == (int(bit == 0.0), text)


@pytest.mark.parametrize("bit", [0.0, 2.5e9])
@pytest.mark.parametrize(
    ("flag", "text"),
    [((), "text\n"), (("--csv",), "csv of 2026\n"), (("--contact-plan",), "plan\n"), (("--json",), "")],
)
def test_a_plan_in_any_form_is_exit_0_where_data_flow(call, folder, monkeypatch, bit, flag, text):
    plan = SimpleNamespace(
        volume_bit=bit, planned="planned", epoch=SimpleNamespace(utc="2026"), contact_plan=lambda: "plan"
    )
    monkeypatch.setattr(plans, "run_constellation", lambda file, loss, progress: plan)
    monkeypatch.setattr(day_study, "given_loss", lambda links: 3.0)
    monkeypatch.setattr("microrad.orbit.operations.csv_text", lambda planned, utc: f"csv of {utc}")
    monkeypatch.setattr("microrad.report.day.constellation.plan_text", lambda found, width: "text")
    monkeypatch.setattr("microrad.report.day.constellation.plan_data", lambda found: {"volume_bit": found.volume_bit})
    path = path_of(folder)
    result = call("constellation", path, *flag)
    assert result.code == int(bit == 0.0)
    if flag == ("--json",):
        assert json.loads(result.out) == {"mission": load_link(path).mission.name, "volume_bit": bit}
    else:
        assert result.out == text


@pytest.mark.parametrize("form", [(), ("--json",), ("--csv",)])
@pytest.mark.parametrize(("name", "code"), [("no contact", 1), ("a share", 0)])
def test_the_exit_code_is_that_of_the_relay_in_each_form(call, folder, form, name, code):
    assert call("contacts", path_of(folder, MISSIONS[name]), *form).code == code


@pytest.mark.parametrize("command", ["contacts", "constellation"])
def test_links_that_cannot_be_computed_are_refused_with_their_file(refused, folder, command, monkeypatch):
    def none(given, *more, **how):
        raise ValueError("no light arrives")

    monkeypatch.setattr("microrad.link.study.run_link_study", none)
    path = path_of(folder, {"constellation": BY_FILE})
    assert f"{path}: no light arrives" in " ".join(refused(command, path).split())


def cannot(*given, **more):
    raise ValueError("it cannot be")


@pytest.mark.parametrize(
    ("command", "form", "part"),
    [
        ("contacts", "--csv", "microrad.orbit.day.run_day_study"),
        ("contacts", "--json", "microrad.orbit.day.run_day_study"),
        ("constellation", "--json", "microrad.orbit.day.given_loss"),
        ("constellation", "--json", "microrad.orbit.constellation.run_constellation"),
        ("constellation", "--csv", "microrad.orbit.operations.csv_text"),
        ("constellation", "--contact-plan", "plan"),
    ],
)
def test_a_day_and_a_plan_that_cannot_be_computed_are_refused_with_their_file(
    refused, folder, monkeypatch, command, form, part
):
    plan = SimpleNamespace(volume_bit=1.0, planned="planned", epoch=SimpleNamespace(utc="2026"), contact_plan=cannot)
    monkeypatch.setattr(day_study, "given_loss", lambda links: 3.0)
    monkeypatch.setattr(plans, "run_constellation", lambda file, loss, progress: plan)
    if part != "plan":
        monkeypatch.setattr(part, cannot)
    path = path_of(folder)
    assert refused(command, path, form) == f"microrad: {path}: it cannot be\n"


@pytest.mark.parametrize(
    ("command", "flags", "named"),
    [
        ("contacts", ("--html", "--json"), "--csv, --html and --json"),
        ("contacts", ("--csv", "--json"), "--csv, --html and --json"),
        ("constellation", ("--csv", "--json"), "--csv, --contact-plan and --json"),
        ("constellation", ("--contact-plan", "--json"), "--csv, --contact-plan and --json"),
    ],
)
def test_forms_that_exclude_each_other_are_named_before_any_file_is_read(refused, folder, command, flags, named):
    said = refused(command, "nowhere.toml", *flags)
    assert said == f"microrad: {named} exclude each other; give one of them.\n"


def test_a_plan_is_of_the_loss_of_the_links_and_has_the_name_of_its_mission(call, folder, monkeypatch):
    asked = []
    plan = SimpleNamespace(volume_bit=1.0)
    monkeypatch.setattr(day_study, "given_loss", lambda links: asked.append(links) or 2.75)
    monkeypatch.setattr(
        plans, "run_constellation", lambda file, loss, progress: asked.append((file, loss, callable(progress))) or plan
    )
    monkeypatch.setattr("microrad.report.day.constellation.plan_data", lambda found: {"same": found is plan})
    path = path_of(folder)
    data = json.loads(call("constellation", path, "--json").out)
    links, (file, loss, told) = asked
    assert data == {"mission": file.mission.name, "same": True}
    assert (file, loss, told) == (links.file, 2.75, True)


@pytest.mark.parametrize("form", [(), ("--json",), ("--csv",), ("--html",)])
def test_each_form_of_a_day_is_of_that_day_and_has_the_sources_of_its_mission(call, folder, monkeypatch, form):
    asked = []
    day = SimpleNamespace(relay=SimpleNamespace(capacity_bit=1.0))
    sources = {"orbit.epoch": "a source"}
    links = SimpleNamespace(file=SimpleNamespace(mission=SimpleNamespace(name="a mission"), sources=sources))
    monkeypatch.setenv("COLUMNS", "98")
    monkeypatch.setattr("microrad.mission.file.load_link", lambda file: asked.append(str(file)) or "given")
    monkeypatch.setattr(link_study, "run_link_study", lambda given: asked.append(given) or links)
    monkeypatch.setattr(
        day_study, "run_day_study", lambda links, on_progress: asked.append((links, callable(on_progress))) or day
    )
    monkeypatch.setattr("microrad.report.marks.with_marks", lambda data, of: {**data, "marks": of})
    monkeypatch.setattr("microrad.report.day.data.day_data", lambda found: {"same": found is day})
    monkeypatch.setattr("microrad.report.day.data.day_csv", lambda found: f"csv {found is day}")
    monkeypatch.setattr("microrad.report.day.page.day_page", lambda found, of: f"<!page {found is day} {of is links}>")
    monkeypatch.setattr("microrad.report.day.page.day_text", lambda found, width, of: f"{found is day} {width} {of}")
    result = call("contacts", "a/day.toml", *form)
    assert (result.code, result.err, asked) == (0, "", ["a/day.toml", "given", (links, True)])
    if form == ("--json",):
        assert json.loads(result.out) == {"mission": "a mission", "same": True, "marks": sources}
        return
    out = {"--csv": "csv True", "--html": "<!page True True>"}
    assert result.out == f"{out[form[0]] if form else f'True 98 {sources}'}\n"


@pytest.mark.parametrize(
    ("form", "out"), [((), "True 98"), (("--csv",), "csv of planned at 2026"), (("--contact-plan",), "plan")]
)
def test_each_form_of_a_plan_is_of_that_plan(call, folder, monkeypatch, form, out):
    plan = SimpleNamespace(
        volume_bit=1.0, planned="planned", epoch=SimpleNamespace(utc="2026"), contact_plan=lambda: "plan"
    )
    monkeypatch.setenv("COLUMNS", "98")
    monkeypatch.setattr("microrad.mission.file.load_link", lambda file: "given")
    monkeypatch.setattr(link_study, "run_link_study", lambda given: SimpleNamespace(file=given))
    monkeypatch.setattr(day_study, "given_loss", lambda links: f"loss of {links.file}")
    monkeypatch.setattr(
        plans, "run_constellation", lambda file, loss, progress: plan if loss == f"loss of {file}" else None
    )
    monkeypatch.setattr("microrad.orbit.operations.csv_text", lambda planned, utc: f"csv of {planned} at {utc}")
    monkeypatch.setattr("microrad.report.day.constellation.plan_text", lambda found, width: f"{found is plan} {width}")
    assert call("constellation", "a/day.toml", *form) == (0, f"{out}\n", "")
