"""The commands of the links: budget with each of its flags, presets, and init with one; what each refuses, in words."""

import csv
import io
import json
import math
import re
import shlex
from types import SimpleNamespace

import pytest
import typer

from command_line import listing
from link_files import PATTERN, RECEIVERS, data_with, received_with, written
from microrad import cli
from microrad.cli import link as cli_link
from microrad.link import study as link_study
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text
from microrad.report.links.budgets import links_text
from preset_files import EXAMPLES, NAMES, as_file, statements
from report_pages import assert_sound, without_scripts
from shipped import SHIPPED, without_fine_pointing

QUICK = {"acquisition.runs": 100, "acquisition.scan": None}
BARE = dict.fromkeys(("beacon", "answer", "acquisition", "point_ahead"))
JITTER = {"jitter": {"bias": ["1 urad", "0 urad"], "rms": ["3 urad", "3 urad"], "bandwidth": "50 Hz"}}
DARK = {"answer.transmit_power": "1 mW"}  # an answer below the noise of the tracking sensor
FORMS = ((), ("--csv",), ("--json",), ("--html",))
NO_NUMBER = re.compile(r"\b(nan|inf|NaN|Infinity|None)\b")


study_of = link_study.run_link_study


@pytest.fixture(scope="module")
def studies():
    """Every study of this file's tests, by the text of its file and its mission."""
    return {}


@pytest.fixture(autouse=True)
def each_study_once(monkeypatch, studies):
    """The same mission is studied once for all its forms."""

    def run(file):
        key = (file.text, repr(file.mission))
        if key not in studies:
            studies[key] = study_of(file)
        return studies[key]

    monkeypatch.setattr(link_study, "run_link_study", run)


def file_with(folder, *changes):
    """A file of the paper's links with changes; quick to make a budget of."""
    merged = dict(QUICK)
    for each in changes:
        gone = {key for key, value in each.items() if value is None}
        merged = {key: value for key, value in merged.items() if key.partition(".")[0] not in gone} | each
    return written(folder, data_with(merged))


def said(result, start):
    """The one printed sentence that starts so, without its line breaks."""
    (block,) = re.findall(rf"(?m)^{re.escape(start)}(?:.|\n(?! \S|\n|- |[A-Z]))*", result.out)
    return " ".join(block.split())


# ----------------------------------------------------------------------------------------------------- the plain table
@pytest.mark.promise("readme-5", "report-7")
@pytest.mark.promise("link-1", "link-2")
@pytest.mark.promise("readme-23")
def test_the_shipped_mission_has_a_budget_and_closes(call, folder):
    path = folder / "leo-geo.toml"
    text = without_fine_pointing(SHIPPED.read_text(encoding="utf-8"))
    assert text.count("runs = 4000 ") == 1
    path.write_text(text.replace("runs = 4000 ", "runs = 100 "), encoding="utf-8")
    result, whole = call("budget", path), call("budget", path, "--verbose")
    assert (result.code, result.err) == (whole.code, whole.err) == (0, "")
    light = "The answer's light on the tracking sensor"
    tables = ("Open-loop pointing", "Communication", "Beacon", "Answer", light)
    assert [line for line in result.out.splitlines() if line in tables] == list(tables[1:4])
    assert [line for line in whole.out.splitlines() if line in tables] == list(tables)
    for each in (result, whole):
        assert said(each, "The links close") == (
            "The links close, and every requirement is met, 2 of 4 by the choice of an input: communication +3.00 dB, "
            "beacon +6.30 dB, answer +9.51 dB."
        )
    assert "source: paper: Table 2" in whole.out
    assert "Marked \u201c!\u201d in the tables:" in whole.out


@pytest.mark.promise("gallery-4")
def test_an_edited_aperture_moves_the_margin_by_its_area_and_its_beam(call, folder):
    before = json.loads(call("budget", file_with(folder), "--json").out)["budgets"][0]["margin_db"]
    after = json.loads(call("budget", file_with(folder, {"terminals.leo_aperture": "6 cm"}), "--json").out)
    # gain D^2, and the off-axis loss of exp(-2 (error pi D / (2 lambda))^2)
    loss = 10 / math.log(10) * 2 * (10e-6 * math.pi / (2 * 1.55e-6)) ** 2
    expected = 20 * math.log10(6 / 5) - loss * (0.06**2 - 0.05**2)
    assert after["budgets"][0]["margin_db"] - before == pytest.approx(expected, abs=1e-9)


@pytest.mark.promise("report-7")
@pytest.mark.promise("link-3")
def test_a_link_that_does_not_close_is_exit_code_1_with_a_minus_sign(call, folder):
    result = call("budget", file_with(folder), "--data-rate", "1 Gbit/s")
    assert (result.code, result.err) == (1, "")
    assert said(result, "The links do not close").startswith("The links do not close: communication \u22122.23 dB,")
    for form in FORMS[1:]:
        assert call("budget", file_with(folder), "--data-rate", "1 Gbit/s", *form).code == 1


@pytest.mark.promise("link-3")
@pytest.mark.parametrize(("flags", "code"), [((), 1), (("--exit-on", "closes"), 0)])
def test_links_that_close_may_be_asked_for_alone(call, folder, flags, code):
    """The beacon covers its partner for 53 % of the satellites' times, and every margin is above 0 dB."""
    path = file_with(folder, {"pointing.confidence": 0.99})
    assert call("budget", path, *flags).code == code
    assert call("budget", path, *flags, "--data-rate", "1 Gbit/s").code == 1


@pytest.mark.parametrize("width", [80, 120, 160])
def test_the_tables_keep_to_their_width_and_cut_no_word(folder, width):
    study = link_study.run_link_study(load_link(file_with(folder, DARK, JITTER)))
    for text in (links_text(study, width, verbose=verbose) for verbose in (False, True)):
        assert width - 10 < max(map(len, text.splitlines())) <= width
        assert "\u2026" not in text
        assert not any(line != line.rstrip() for line in text.splitlines())


# ------------------------------------------------------------------------------------------- what stands in its place
def test_a_data_rate_on_the_command_line_stands_in_place_of_the_missions(call, folder):
    path = file_with(folder)
    found = json.loads(call("budget", path, "--data-rate", "600 Mbit/s", "--json").out)
    plain = json.loads(call("budget", path, "--json").out)
    assert plain["budgets"][0]["margin_db"] - found["budgets"][0]["margin_db"] == pytest.approx(10 * math.log10(2))
    (line,) = [each for each in found["budgets"][0]["totals"] if each["name"] == "Required power"]
    assert "command line" in line["source"]
    assert "600 Mbit/s" in line["basis"]


def test_a_pointing_error_on_the_command_line_stands_in_place_of_the_missions(call, folder):
    found = json.loads(call("budget", file_with(folder), "--pointing-error", "0 urad", "--json").out)
    (line,) = [each for each in found["budgets"][0]["lines"] if each["name"] == "Pointing loss"]
    assert (line["value"], line["source"]) == (0.0, "command line")
    assert found["budgets"][1] == json.loads(call("budget", file_with(folder), "--json").out)["budgets"][1]


@pytest.mark.parametrize(
    ("change", "flags", "which"),
    [
        ({}, ("--pointing-error", "5 urad"), "the required 10 µrad"),
        (JITTER, (), r"\d+\.\d+ µrad under the jitter"),
    ],
)
def test_the_largest_rate_says_whose_error_it_is_for(call, folder, change, flags, which):
    printed = call("budget", file_with(folder, change), *flags).out
    assert re.search(rf"Largest data rate with the required 3 dB at {which}: \d+", " ".join(printed.split()))


@pytest.mark.parametrize("flags", [("--solve", "communication.data_rate"), ("--data-rate", "largest")])
def test_the_solved_rate_has_the_required_margin(call, folder, flags):
    path = file_with(folder, {"terminals.leo_aperture": "6 cm", "pointing.confidence": 0.5})
    result = call("budget", path, *flags, "--json")
    found = json.loads(result.out)
    assert result.code == 0
    assert found["budgets"][0]["margin_db"] == pytest.approx(3.0, abs=1e-9)
    again = json.loads(call("budget", path, "--data-rate", f"{found['largest_data_rate_bit_s']!r} bit/s", "--json").out)
    assert again["budgets"][0]["margin_db"] == pytest.approx(3.0, abs=1e-9)


def test_a_solved_rate_ends_at_the_receivers_bandwidth(call, folder):
    path = file_with(folder, received_with("preamplified dpsk"))
    found = json.loads(call("budget", path, "--data-rate", "largest", "--json").out)
    assert found["largest_data_rate_bit_s"] == pytest.approx(4e9 * 0.8)
    assert found["budgets"][0]["margin_db"] > 3.0


@pytest.mark.promise("link-2")
def test_flags_may_be_given_together(call, folder):
    result = call("budget", file_with(folder), "--data-rate", "1 Gbit/s", "--pointing-error", "5 urad", "--json")
    assert json.loads(result.out)["budgets"][0]["margin_db"] == pytest.approx(3.0 - 5.2288 + 0.75 * 2.2301, abs=2e-3)


# ---------------------------------------------------------------------------------------------------------------- JSON
def finite(data, path=""):
    """Every number of a document with its path; fails on a text that stands for one."""
    if isinstance(data, dict):
        return [each for key, value in data.items() for each in finite(value, f"{path}.{key}")]
    if isinstance(data, list):
        return [each for place, value in enumerate(data) for each in finite(value, f"{path}[{place}]")]
    return [(path, data)] if isinstance(data, int | float) and not isinstance(data, bool) else []


@pytest.mark.promise("link-1", "link-2")
def test_json_is_one_document_of_finite_numbers_with_units_in_their_keys(call, folder):
    result = call(
        "budget", file_with(folder, JITTER, {"acquisition.scan": data_with({})["acquisition"]["scan"]}), "--json"
    )
    found = json.loads(result.out)
    numbers = finite(found)
    assert len(numbers) > 150
    assert all(math.isfinite(value) for _, value in numbers)
    bare = re.compile(
        r"(_db|_w|_w_m2|_w_sr|_rad|_s|_bit_s|_per_s|probability|coverage|confidence|detection|outage|runs|noise|angles"
        r"|rms_rad\[\d\]|bias_rad\[\d\]|\.below_required_margin)$"
    )
    # what carries its unit beside it: a line's value, an input of the tornado
    assert {path for path, _ in numbers if not bare.search(path)} == {
        path
        for path, _ in numbers
        if re.search(
            r"(lines|totals|noise)\[\d+\]\.value$|received_photons_per_bit$|tornado\[\d+\]\.(value|low|high)$"
            r"|requirements\[\d+\]\.",
            path,
        )
    }
    assert found["closes"] is True
    left = {each["name"]: each["largest_rad"] for each in found["pointing"]["left_for_each"]}
    assert left["Orbit knowledge"] == pytest.approx(math.sqrt(390**2 - 300**2 - 248**2 - 1) * 1e-6, rel=1e-6)
    assert [each["name"] for each in found["budgets"]] == ["Communication", "Beacon", "Answer"]
    assert [each["name"] for each in found["acquisition"]["ways"]] == ["wide beacon", "spiral scan"]
    assert found["point_ahead"]["angle_rad"] == pytest.approx(2 * 10.65e3 / 299_792_458)


def test_each_budget_of_the_json_is_the_sum_of_its_lines(call, folder):
    found = json.loads(call("budget", file_with(folder), "--json").out)
    for budget in found["budgets"]:
        received, required, margin = (line["value"] for line in budget["totals"])
        assert math.fsum(line["value"] for line in budget["lines"]) == pytest.approx(received, abs=1e-9)
        assert received - required == pytest.approx(margin, abs=1e-9)
        assert margin == pytest.approx(budget["margin_db"], abs=1e-9)
        assert received == pytest.approx(10 * math.log10(budget["received_power_w"] * 1e3), abs=1e-9)


def test_what_is_no_number_is_null_in_the_json(call, folder):
    path = file_with(folder, received_with("preamplified dpsk"), {"communication.data_rate": "3.1 Gbit/s"})
    result = call("budget", path, "--json")
    (rate,) = [each for each in json.loads(result.out)["tornado"] if each["input"] == "communication.data_rate"]
    assert rate["margin_high_db"] is None
    assert math.isfinite(rate["margin_low_db"])
    assert not re.search(r"NaN|Infinity", result.out)


def test_the_noise_of_a_receiver_is_in_every_form(call, folder):
    path = file_with(folder, received_with("pin ook", background_power=None))
    path.write_text(
        path.read_text().replace("[communication.receiver]", '[communication.receiver]\nbackground_power = "10 pW"')
    )
    found = json.loads(call("budget", path, "--json").out)
    names = [line["name"] for line in found["receiver_noise"]]
    assert "Thermal noise" in names
    for form in (("--verbose",), ("--csv",), ("--html",)):
        assert all(name in call("budget", path, *form).out.replace("&#39;", "'") for name in names[-1:])
    assert json.loads(call("budget", file_with(folder), "--json").out)["receiver_noise"] == []


# ----------------------------------------------------------------------------------------------------------------- CSV
def rows(text):
    return list(csv.reader(io.StringIO(text)))


@pytest.mark.promise("link-2")
def test_csv_is_a_table_with_a_heading_and_one_line_a_row(call, folder):
    result = call("budget", file_with(folder), "--csv")
    heading, *body = rows(result.out)
    assert heading == ["budget", "line", "value", "unit", "basis", "source", "holds for", "warning"]
    assert {len(row) for row in body} == {len(heading)}
    assert len(result.out.splitlines()) == 1 + len(body)  # no cell holds a line break
    assert {row[3] for row in body} == {"dB", "dBm", "rad", "A"}
    assert all(math.isfinite(float(row[2])) for row in body)
    assert "\u2212" not in "".join(row[2] for row in body)  # a spreadsheet reads a hyphen


@pytest.mark.promise("readme-7")
def test_csv_holds_the_same_numbers_as_the_json_to_the_last_digit(call, folder):
    path = file_with(folder)
    found = json.loads(call("budget", path, "--json").out)
    expected = [
        (budget["name"], line["name"], line["value"])
        for budget in found["budgets"]
        for line in (*budget["lines"], *budget["totals"])
    ]
    body = rows(call("budget", path, "--csv").out)[1:]
    assert [(row[0], row[1], float(row[2])) for row in body][: len(expected)] == expected


def test_csv_quotes_what_a_comment_says(call, folder):
    path = file_with(folder)
    text = path.read_text(encoding="utf-8")
    line = 'transmit_power = "5 W"'
    assert text.count(line) == 1
    comment = 'literature: "laser, 5 W"; <b>2021</b>, \u00b1 1 %'
    path.write_text(text.replace(line, f"{line} # {comment}"), encoding="utf-8")
    (row,) = [r for r in rows(call("budget", path, "--csv").out) if r[:2] == ["Communication", "Transmit power"]]
    assert row[5] == comment


def test_csv_has_no_formula_that_a_mission_brings_along(call, folder):
    path = file_with(folder)
    text = path.read_text(encoding="utf-8")
    formula = '=HYPERLINK("http://example.org")'
    path.write_text(text.replace('transmit_power = "5 W"', f'transmit_power = "5 W" # {formula}'), encoding="utf-8")
    body = rows(call("budget", path, "--csv").out)
    (row,) = [r for r in body if r[:2] == ["Communication", "Transmit power"]]
    assert row[5] == f"'{formula}"
    path.write_text(text.replace("[terminals]\n", '[terminals]\nleo_name = "=1+1"\n'), encoding="utf-8")
    body += rows(call("budget", path, "--csv").out)
    assert "'=1+1 aperture gain" in {row[1] for row in body}
    assert not [cell for row in body for k, cell in enumerate(row) if k != 2 and cell[:1] in ("=", "+", "-", "@")]


# ---------------------------------------------------------------------------------------------------------------- HTML
@pytest.mark.promise("readme-7", "report-12")
@pytest.mark.promise("link-1", "link-2")
def test_html_is_one_page_that_loads_nothing(call, folder):
    path = file_with(folder, JITTER, {"acquisition.scan": data_with({})["acquisition"]["scan"]})
    page = call("budget", path, "--html").out
    assert page.startswith("<!DOCTYPE html>")
    assert page.rstrip().endswith("</html>")
    assert_sound(page)
    assert len(page) < 250_000  # bars and curves with their numbers below: no drawing library
    page = without_scripts(page)
    assert page.count('<svg role="img"') == 4
    assert not re.search(r"<(script|link|img|iframe|object|embed)\b|@import|url\((?!#)", page)
    assert all(target.startswith("#") for target in re.findall(r'(?:href|src)="([^"]*)"', page))
    assert not NO_NUMBER.search(re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL))
    for heading in ("Open-loop pointing", "Link budgets", "What pointing costs the link", "Acquisition"):
        assert len(re.findall(f">{heading}<a ", page)) == 1
    assert "figures/" not in page  # no data stand beside it


def test_the_page_says_what_the_command_line_gave(call, folder):
    page = call("budget", file_with(folder), "--pointing-error", "5 urad", "--html").out
    assert re.search(r"communication\.pointing_error</code></td><td>5 urad</td><td>command line</td>", page)


# ---------------------------------------------------------------------------------------------------------- other files
@pytest.mark.promise("readme-7")
@pytest.mark.parametrize(
    "changes",
    [
        BARE,
        {"beacon": None},
        {"answer": None},
        {"acquisition": None},
        {"acquisition.sensor": None},
        JITTER,
        PATTERN,
        {"point_ahead.corrected": False},
        DARK,
        {"communication.distance": "1e9 km"},
    ],
    ids="-".join,
)
def test_every_kind_of_file_has_a_budget_in_every_form(call, folder, changes):
    path = file_with(folder, changes)
    for form in FORMS:
        result = call("budget", path, *form)
        assert result.code in (0, 1), result.err
        assert result.err == ""
        assert result.out
        assert not NO_NUMBER.search(re.sub(r"<svg.*?</svg>", "", without_scripts(result.out), flags=re.DOTALL))


@pytest.mark.promise("readme-7")
@pytest.mark.parametrize("name", RECEIVERS)
def test_every_receiver_has_a_budget_in_every_form(call, folder, name):
    path = file_with(folder, BARE, received_with(name))
    for form in FORMS:
        result = call("budget", path, *form)
        assert (result.code in (0, 1), result.err) == (True, "")


@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-1")
def test_a_file_of_links_alone_has_no_more_than_they(call, folder):
    result = call("budget", file_with(folder, BARE))
    assert said(result, "The links close") == "The links close, and every requirement is met: communication +3.00 dB."
    assert not re.search(r"beacon|Acquisition|Point-ahead:|tracking sensor:", result.out)


def test_an_answer_below_the_noise_is_said_to_be_and_nothing_locks(call, folder):
    result = call("budget", file_with(folder, DARK), "--verbose")
    assert said(result, "- The answer brings").endswith("less than its noise in a reading (signal to noise 0.17).")
    assert re.search(r"(?m)^ wide beacon +never +0\.0000 ", result.out)


def test_a_point_ahead_beyond_the_formula_costs_more_than_it_holds_for(call, folder):
    corrected = said(call("budget", file_with(folder), "--verbose"), "- Point-ahead:")
    assert "left out, it would cost more than 20 dB;" in corrected
    assert corrected.endswith("corrected here.")
    left = {"point_ahead.corrected": False, "point_ahead.transverse_velocity": "1 km/s"}
    uncorrected = said(call("budget", file_with(folder, left), "--verbose"), "- Point-ahead:")
    # 2 v / c beside an error of 10 urad, in a beam of 2 lambda / (pi D)
    ahead, half = 2e3 / 299_792_458, 2 * 1.55e-6 / (math.pi * 0.05)
    loss = 20 / math.log(10) * ((10e-6 + ahead) ** 2 - 10e-6**2) / half**2
    assert f"left out, it costs {loss:.1f} dB;" in uncorrected
    assert uncorrected.endswith("NOT corrected here.")


def test_an_input_that_a_receiver_does_not_take_leaves_no_infinite_swing(call, folder):
    path = file_with(folder, received_with("preamplified dpsk"), {"communication.data_rate": "3.1 Gbit/s"})
    line = said(call("budget", path), "What moves the margin most")
    assert "communication.data_rate takes the link beyond its receiver" in line


@pytest.mark.promise("link-39")
def test_jitter_is_said_with_its_outage(call, folder):
    line = said(call("budget", file_with(folder, JITTER), "--verbose"), "Under the jitter")
    assert re.fullmatch(
        r"Under the jitter: mean pointing loss 0\.40 dB; 2\.4\d dB at most for 99\.7 % of the time, which leaves a "
        r"margin of \+2\.7\d dB; below 0 dB for a share of 4\.\d+e-06 of the time; "
        r"best half angle 19\.7 \u00b5rad, the narrowest of the aperture\. Power that it costs: with a code 0\.40 dB "
        r"where its interleaver spans many fades, 2\.4\d dB where it spans none; without a code unknown, as the "
        r"receiver is given by its sensitivity alone\.",
        line,
    )


# ------------------------------------------------------------------------------------------------------------ refusals
@pytest.mark.parametrize(
    ("args", "words"),
    [
        (
            ("--data-rate", "300 MHz"),
            '--data-rate: "300 MHz" is in "MHz", another kind of quantity; expected a data rate',
        ),
        (("--data-rate", "300"), '--data-rate: "300" is a number without a unit; expected a data rate'),
        (("--data-rate", "fast"), '--data-rate: "fast" does not begin with a plain number'),
        (("--data-rate", "0 bit/s"), '--data-rate: "0 bit/s" is not above 0 bit/s'),
        (("--data-rate", "-1 Mbit/s"), '--data-rate: "-1 Mbit/s" is not above 0 bit/s'),
        (("--data-rate", "nan Mbit/s"), '--data-rate: "nan Mbit/s" does not begin with a plain number'),
        (("--data-rate", ""), '--data-rate: "" does not begin with a plain number'),
        (("--pointing-error", "5 W"), '--pointing-error: "5 W" is in "W", another kind of quantity; expected an angle'),
        (("--pointing-error", "5"), '--pointing-error: "5" is a number without a unit; expected an angle'),
        (("--pointing-error", "-5 urad"), '--pointing-error: "-5 urad" is below 0 rad'),
        (("--pointing-error", "2 rad"), '--pointing-error: "2 rad" is above 1.571 rad'),
        (("--solve", "leo_aperture"), 'a quantity "leo_aperture"; did you mean terminals.leo_aperture?'),
        (("--solve", "communication.recieve_optics_loss"), "did you mean communication.receive_optics_loss"),
        (("--solve", "zzz"), 'a quantity "zzz"; there are terminals.leo_aperture, '),
        (
            ("--pointing-error", "0 urad", "--solve", "communication.pointing_error"),
            "is 0, which no factor moves: give",
        ),
        (("--csv", "--json"), "--csv, --html and --json exclude each other; give one of them."),
        (("--csv", "--html"), "exclude each other"),
        (("--html", "--json"), "exclude each other"),
        (("--csv", "--html", "--json"), "exclude each other"),
        (("--margin", "3 dB"), "No such option: --margin"),
    ],
)
def test_a_flag_that_cannot_be_meant_is_refused_in_words(refused, folder, args, words):
    assert words in refused("budget", file_with(folder), *args)


@pytest.mark.promise("link-26")
@pytest.mark.parametrize("name", ["preamplified dpsk", "counting ppm", "pin ook"])
def test_a_rate_above_the_receivers_bandwidth_is_refused_with_the_most_it_takes(refused, folder, name):
    path = file_with(folder, received_with(name))
    for form in FORMS:
        message = refused("budget", path, "--data-rate", "50 Gbit/s", *form)
        assert message.startswith(f"microrad: {path}: the data rate is 50 Gbit/s")
        assert re.search(r"the receiver takes 4 GHz, so at most [\d.]+ [MG]bit/s of data\n$", message)


def test_a_rate_that_no_margin_leaves_is_refused_with_its_reason(refused, folder):
    path = file_with(folder, received_with("counting ppm"), {"requirement.margin": "200 dB"})
    message = refused("budget", path, "--data-rate", "largest")
    assert message.startswith(f"microrad: {path}: ")
    assert "200 dB" in message


@pytest.mark.promise("link-3")
def test_no_file_a_folder_and_a_faulty_file_are_refused_with_what_to_do(refused, folder):
    assert "does not exist" in refused("budget", "none.toml")
    assert "is a directory" in refused("budget", folder)
    assert "Missing argument" in refused("budget")
    path = file_with(folder, {"communication.distance": "42000 W", "answer.divergence": "-1 urad"})
    message = refused("budget", path)
    assert "2 faults to correct" in message
    assert "communication.distance" in message
    assert "answer.divergence" in message


# ------------------------------------------------------------------------------------------------------------- presets
@pytest.mark.promise("readme-5", "readme-7")
@pytest.mark.promise("link-2")
@pytest.mark.promise("readme-23")
def test_presets_are_listed_with_what_is_missing_from_each(call, folder):
    result = call("presets")
    assert (result.code, result.err) == (0, "")
    lines = result.out.splitlines()
    rows = {
        line.split()[0]: line.split()[-1] for line in lines if line.startswith(tuple(f" {name} " for name in NAMES))
    }
    assert rows == {name: str(len(EXAMPLES[name]) or "nothing") for name in NAMES}
    assert lines[-1] == "microrad init --preset NAME writes one."
    assert not listing(folder)


def test_presets_as_json_name_every_unknown_key(call):
    found = json.loads(call("presets", "--json").out)
    assert {each["name"]: set(each["unknown"]) for each in found} == {name: set(EXAMPLES[name]) for name in NAMES}
    assert all(each["title"] for each in found)


@pytest.mark.promise("gallery-17", "readme-5", "readme-7")
@pytest.mark.promise("link-2", "link-55")
@pytest.mark.parametrize("name", NAMES)
def test_a_preset_is_written_and_its_budget_asks_for_each_unknown_key_once(call, folder, name):
    result = call("init", "--preset", name, f"{name}.toml")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"{name}.toml written. ")
    assert result.out.endswith(f"Next: microrad {'run' if name == 'paper' else 'budget'} {name}.toml\n")
    assert (folder / f"{name}.toml").read_text(encoding="utf-8") == preset_text(name)
    assert all(key in result.out for key in EXAMPLES[name])
    before = listing(folder)
    budget = call("budget", f"{name}.toml")
    assert listing(folder) == before
    assert "Traceback" not in budget.err
    if not EXAMPLES[name]:
        assert (budget.code, budget.err) == (0, "")
        return
    assert (budget.code, budget.out) == (2, "")
    faults = re.findall(r"line \d+: (\S+) = \"unknown\"\n    is in no source", budget.err)
    assert sorted(faults) == sorted(EXAMPLES[name])
    assert f"{len(faults)} faults to correct" in budget.err


@pytest.mark.parametrize("name", [name for name in NAMES if EXAMPLES[name]])
def test_a_preset_with_its_unknown_values_given_has_a_budget(call, folder, name):
    text = preset_text(name).split("\n")
    for each in statements(preset_text(name)):
        if each.value == '"unknown"':
            text[each.line - 1] = f"{each.key.rpartition('.')[2]} = {EXAMPLES[name][each.key]}"
    result = call("budget", as_file(folder, name, "\n".join(text)), "--json")
    assert (result.code in (0, 1), result.err) == (True, "")
    assert math.isfinite(json.loads(result.out)["budgets"][0]["margin_db"])


def test_init_with_a_preset_overwrites_nothing(call, refused, folder):
    (folder / "click.toml").write_text("mine", encoding="utf-8")
    assert "click.toml exists and is left as it is; name another one" in refused(
        "init", "--preset", "click", "click.toml"
    )
    assert "there is no folder none; create it first" in refused("init", "--preset", "click", "none/click.toml")
    assert (folder / "click.toml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("name", "words"),
    [("oicets", "did you mean oicets-artemis"), ("", "there are click"), ("../leo-geo", "no preset")],
)
def test_a_preset_that_there_is_not_is_refused_with_those_that_there_are(refused, folder, name, words):
    assert words in refused("init", "--preset", name, "x.toml")


# ---------------------------------------------------------------------------------------------------------------- help
@pytest.mark.parametrize("command", ["budget", "presets", "init"])
def test_the_examples_of_the_help_are_good_usage(call, command):
    group = typer.main.get_command(cli.app)
    help_text = call(command, "--help").out
    lines = [line.strip() for line in help_text.partition("Examples:")[2].splitlines() if line.strip()]
    assert lines
    for line in lines:
        _, name, *args = shlex.split(line.partition(" > ")[0])
        group.commands[name].make_context(name, args)


def test_the_help_names_every_flag(call):
    text = call("budget", "--help").out
    for flag in ("--data-rate RATE", "--pointing-error ANGLE", "--solve KEY", "--csv", "--html", "--json"):
        assert flag in text


# ----------------------------------------------------------------------------------------------- handed on, one by one
@pytest.mark.parametrize(
    "given", [(), ("--solve", "a.key"), ("--standard", "sda"), ("--standard", "sda", "--solve", "a.key")]
)
@pytest.mark.parametrize("form", [(), ("--verbose",), ("--json",), ("--csv",), ("--html",)])
@pytest.mark.parametrize(("exit_on", "code"), [((), 1), (("closes",), 0)])
def test_a_budget_in_each_form_has_what_was_solved_and_the_standard(call, monkeypatch, given, form, exit_on, code):
    asked, study = [], SimpleNamespace(closes=True)
    solved, against = ("a.key" if "--solve" in given else None), ("sda" if "--standard" in given else None)
    found = SimpleNamespace(file="the solved file")
    loaded = SimpleNamespace(mission=SimpleNamespace(jitter=None))
    monkeypatch.setenv("COLUMNS", "97")
    monkeypatch.setattr("microrad.mission.file.load_link", lambda file: asked.append(str(file)) or loaded)
    monkeypatch.setattr(cli_link, "_changed", lambda file, rate, error: (file, rate, error))
    monkeypatch.setattr(link_study, "solve_key", lambda given, key: asked.append((given, key)) or found)
    monkeypatch.setattr(link_study, "run_link_study", lambda given: asked.append(given) or study)
    monkeypatch.setattr("microrad.link.compliance.standard", lambda name: f"rules of {name}")
    monkeypatch.setattr("microrad.link.compliance.compliance", lambda of, rules: (of is study, rules))
    monkeypatch.setattr("microrad.link.requirement.met", lambda of: False)
    told = (found if solved else None, (True, f"rules of {against}") if against else None)
    budgets = "microrad.report.links"
    monkeypatch.setattr(f"{budgets}.data.links_data", lambda of, *more: {"same": more == told})
    monkeypatch.setattr(f"{budgets}.budgets.links_csv", lambda of, *more: f"csv {more == told}")
    monkeypatch.setattr(f"{budgets}.views.links_page", lambda of, *more: f"<!page {more == told}>")
    monkeypatch.setattr(
        f"{budgets}.budgets.links_text",
        lambda of, width, verbose, solution, against: f"{width} {verbose} {(solution, against) == told}",
    )
    options = ("--data-rate", "1 Gbit/s", "--pointing-error", "2 urad")
    result = call("budget", "a/day.toml", *options, *given, *form, *(f"--exit-on={each}" for each in exit_on))
    out = {"--json": '{\n  "same": true\n}', "--csv": "csv True", "--html": "<!page True>", "--verbose": "97 True True"}
    assert (result.code, result.out) == (code, f"{out[form[0]] if form else '97 False True'}\n")
    changed = (loaded, "1 Gbit/s", "2 urad")
    assert asked == ["a/day.toml", *([(changed, solved), "the solved file"] if solved else [changed])]


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (("--solve", "a.key"), "microrad.link.study.solve_key"),
        ((), "microrad.link.study.run_link_study"),
        (("--standard", "sda"), "microrad.link.compliance.compliance"),
    ],
)
def test_a_budget_that_cannot_be_made_is_refused_with_its_file(refused, folder, monkeypatch, options, part):
    def cannot(*given):
        raise ValueError("no light arrives")

    if part.endswith("compliance"):
        monkeypatch.setattr(link_study, "run_link_study", lambda given: "study")
    monkeypatch.setattr(part, cannot)
    path = file_with(folder)
    assert refused("budget", path, *options) == f"microrad: {path}: no light arrives\n"


def test_a_standard_that_there_is_not_is_refused_under_its_option_before_any_file_is_read(refused, folder):
    assert refused("budget", "nowhere.toml", "--standard", "sdaa").startswith("microrad: --standard: ")


@pytest.mark.parametrize(
    ("given", "there", "advice"),
    [
        (("--preset", "click"), "click.toml", "name another one: microrad init --preset click other.toml"),
        (
            ("--preset", "click", "my link.toml"),
            "my link.toml",
            "name another one: microrad init --preset click other.toml",
        ),
        ((), "leo-geo.toml", "name another one (microrad init other.toml) or go on with `microrad run leo-geo.toml`"),
        (
            ("my day.toml",),
            "my day.toml",
            "name another one (microrad init other.toml) or go on with `microrad run 'my day.toml'`",
        ),
    ],
)
def test_a_mission_that_is_there_is_left_with_what_to_do_instead(refused, folder, given, there, advice):
    (folder / there).write_text("", encoding="utf-8")
    assert refused("init", *given) == f"microrad: {there} exists and is left as it is; {advice}.\n"
