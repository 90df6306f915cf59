"""What is said and drawn: how it becomes lines, and when a line is another one."""

import json

import pytest

from reference import told
from reference.scenes import edited, generic

PAGE = """<html><head><title>no line</title></head><body><h1>A study</h1>
<table><tr><th>what</th><th>how much</th></tr><tr><td>rms</td><td>1.25&nbsp;µrad</td></tr></table>
<svg><text>no line</text></svg><p>Written by microrad 0.3.0.dev0, hash 0123456789abcdef.</p>
<script type="application/json" class="plot">{}</script></body></html>"""
PLOT = {
    "size": [700.0, 400.0],
    "data": [{"name": "left", "x": [1.0, 2.0, 4.0], "marker": {"color": "#000000"}}],
    "layout": {"yaxis": {"title": {"text": "rms (µrad)"}}},
}
LEFT = ["LQG leaves 3.16 µrad, 99.7 % of the time", "9 controllers"]


def test_a_page_is_its_words_a_row_a_line_and_what_its_figures_draw(tmp_path):
    path = tmp_path / "report.html"
    path.write_text(PAGE.format(json.dumps(PLOT)), encoding="utf-8")
    assert told.page(path) == [
        "A study",
        "what | how much",
        "rms | 1.25 µrad",
        "Written by microrad VERSION, hash HASH.",
        "plot of rms (µrad).data[0].name: left",
        "plot of rms (µrad).data[0].x: 1 2 4",
        "plot of rms (µrad).layout.yaxis.title.text: rms (µrad)",
    ]


def test_a_short_curve_is_kept_whole_and_a_long_one_by_what_tells_it_apart():
    assert told.curve([1.0, -2.5e-17, float("nan")]) == "1 0 nan"
    assert told.curve([float(i) for i in range(9)]) == (
        "9, 9, 9 distinct: first 0, last 8, min 0, max 8, mean 4, rms 4.761, slope 2.519"
    )
    assert told.curve([float("nan")] * 9) == "9 without a number"


def test_a_table_is_its_columns(tmp_path):
    path = tmp_path / "loop.csv"
    path.write_text("# of a run\ntime (s),state\n0.5,on\n1.5,off\n", encoding="utf-8")
    assert told.table(path) == ["loop.csv: 2 rows", "loop.csv: time (s): 0.5 1.5", "loop.csv: state: on ; off"]


@pytest.mark.parametrize(
    ("line", "apart"),
    [
        ("LQG leaves 3.18 µrad, 99.7 % of the time", False),  # two of the last place
        ("LQG leaves 3.25 µrad, 99.7 % of the time", True),
        ("LQR leaves 3.16 µrad, 99.7 % of the time", True),
    ],
)
def test_a_word_is_held_to_the_letter_and_a_number_of_a_simulated_loop_nearly(line, apart):
    now = [line, LEFT[1]]
    assert told.differences("case", LEFT, now, simulated=True) == [f"case: - {LEFT[0]}", f"case: + {line}"] * apart
    assert told.differences("case", LEFT, now, simulated=False) == [f"case: - {LEFT[0]}", f"case: + {line}"]


def test_a_line_that_is_new_or_gone_is_named():
    assert told.differences("case", LEFT, LEFT[1:], simulated=True) == [f"case: - {LEFT[0]}"]
    assert told.differences("case", LEFT, [*LEFT, "more"], simulated=False) == ["case: + more"]


def test_lines_are_written_and_read_again(tmp_path):
    told.save(tmp_path / "told" / "case.txt", LEFT)
    assert told.load(tmp_path / "told" / "case.txt") == LEFT
    assert told.load(tmp_path / "none.txt") == []


def test_a_mission_has_numbers_of_its_own_and_keys_set_or_left_out():
    text = '[beam]\npower = "5 W"   # assumption: ours\nseed = 1\nshares = ["0.5 W", "2 W"]\n'
    own = generic(text, 1)
    assert own == generic(text, 1) != generic(text, 2)
    assert "seed = 1\n" in own
    assert own.count("assumption: ours") == 1
    assert '"5 W"' not in own
    changed = edited(text, {"beam.seed": None, "beam.power": '"7 W"', "beam.more": "true", "other.key": "3"})
    assert changed.splitlines() == [
        "[beam]",
        "more = true",
        'power = "7 W"',
        'shares = ["0.5 W", "2 W"]',
        "",
        "[other]",
        "key = 3",
    ]
    with pytest.raises(ValueError, match=r"beam\.less is not there"):
        edited(text, {"beam.less": None})
