"""Lists of error sources as tables of a spreadsheet: what is read, and every refusal in a line."""

import re
from types import SimpleNamespace
from zipfile import ZIP_DEFLATED, ZipFile

import pytest

from budget_files import HEADING, ROWS
from made_tables import made, one_line, told
from microrad.mission import source_list
from microrad.mission.source_list import COLUMNS, SourceListError, read_sources
from microrad.mission.tables.error_budget import BudgetRequirement, BudgetSource, ErrorBudget


def listed(folder, *rows, head=HEADING, name="errors.csv"):
    path = folder / name
    path.write_text("\n".join([head, *rows]) + "\n", "utf-8")
    return path


@pytest.mark.promise("pointing-46")
def test_each_row_is_a_source_as_a_mission_states_it(tmp_path):
    path = listed(tmp_path, *ROWS)
    found = read_sources(path)
    assert [each.name for each in found] == ["alignment", "star tracker", "drift", "wheels", "unloading"]
    first, _, drift, wheels, last = (each.source for each in found)
    assert (first.kind, first.size_rad, first.statistic, first.gains) == ("constant", 2e-6, "3-sigma", (1.0, 0.5))
    assert (drift.rate_rad_s, drift.period_s) == pytest.approx((1e-10, 21600.0), rel=1e-12, abs=0.0)
    assert wheels.corner_hz == 40.0
    assert last.gains == (0.5, -1.0)
    assert [found[0].origin, found[1].origin] == ["ground calibration", f"{path}, row 3"]


def test_an_error_of_each_observation_is_spread(tmp_path):
    (found,) = read_sources(listed(tmp_path, "a,per-observation,1 urad,,3-sigma,each,1,1"))
    assert (found.source.kind, found.source.statistic) == ("per-observation", "3-sigma")


def test_a_text_with_a_byte_order_mark_is_read_as_one_without(tmp_path):
    path, marked = listed(tmp_path, *ROWS), tmp_path / "marked.csv"
    marked.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert [each.source for each in read_sources(marked)] == [each.source for each in read_sources(path)]


@pytest.mark.parametrize("separator", [";", "\t"])
def test_semicolons_and_tabs_separate_cells_too_and_blank_rows_and_columns_are_nothing(tmp_path, separator):
    rows = [row.replace(",", separator) for row in (ROWS[0] + ",,", "," * 13, ROWS[1])]
    path = listed(tmp_path, *rows, head=(HEADING + ",").replace(",", separator).upper())
    assert [each.source.size_rad for each in read_sources(path)] == pytest.approx([2e-6, 3e-6], rel=1e-12, abs=0.0)


@pytest.mark.promise("pointing-44")
def test_a_workbook_is_read_like_a_text(tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="the extra xlsx is not installed")
    book = openpyxl.Workbook()
    for row in (HEADING, *ROWS):
        cells = row.split(",")
        book.active.append([float(cell) if re.fullmatch(r"-?[0-9.]+", cell) else cell or None for cell in cells])
    book.save(tmp_path / "errors.xlsx")
    found = read_sources(tmp_path / "errors.xlsx")
    assert [each.source for each in found] == [each.source for each in read_sources(listed(tmp_path, *ROWS))]


@pytest.mark.promise("pointing-46")
def test_the_columns_are_the_keys_of_a_source():
    assert {*COLUMNS, "x", "y", "z", "origin"} == set(HEADING.split(","))


@pytest.mark.parametrize(
    ("rows", "head", "said"),
    [
        (["a,constant,2 V,,fixed,together,1,1"], HEADING, 'row 2, a: size is in "V"'),
        (["a,constant,,,fixed,together,1,1"], HEADING, "size is missing"),
        (["a,bent,1 urad,,fixed,together,1,1"], HEADING, 'row 2, a: class is "bent"'),
        (["a,constant,1 urad,,fixed,together,1,1,,1 Hz"], HEADING, 'corner does not belong to class = "constant"'),
        (
            ["a,per-observation,1 urad,,fixed,together,1,1"],
            HEADING,
            "statistic leaves no other one in the next observation",
        ),
        (["a,process,1 urad,,fixed,together,1,1,,1 Hz"], HEADING, "statistic does not belong to a process"),
        (["a,random,1 urad,,fixed,together,1,1"], HEADING, "statistic does not belong to a random error"),
        (["a,constant,1 urad,,fixed,together,one,1"], HEADING, 'row 2, x: "one" is no number'),
        (["a,constant,1 urad,,fixed,together,inf,1"], HEADING, "row 2, a: gains"),
        (["a,constant,1 urad,,fixed,together"], HEADING, "gains"),
        ([",constant,1 urad,,fixed,together,1,1"], HEADING, "row 2: has no name"),
        (["a,constant,1 urad,,fixed,together,1,1"] * 2, HEADING, "row 3: is a second 'a'"),
        (["a,constant"], HEADING.replace("size", "length"), 'no column is called "length"'),
        (["a,constant"], "name,class,size,axes,x", 'it has no column "statistic"'),
        (["a,constant"], f'{HEADING},"of\ntwo lines"', 'no column is called "of two lines"'),
        (["a,constant"], HEADING + ",x", "two columns have one name"),
        ([], HEADING, "holds no source"),
        (['"a,constant'], HEADING, "is no table of cells"),
    ],
)
def test_what_is_no_source_is_refused_in_a_line(tmp_path, rows, head, said):
    with pytest.raises(SourceListError, match=re.escape(said)) as refused:
        read_sources(listed(tmp_path, *rows, head=head))
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith(str(tmp_path))


@pytest.mark.promise("pointing-44")
def test_files_that_are_no_list_are_refused(tmp_path):
    with pytest.raises(SourceListError, match="cannot be read"):
        read_sources(tmp_path / "none.csv")
    (tmp_path / "other.csv").write_bytes(b"\xff\xfe\x00name")
    with pytest.raises(SourceListError, match="no text in UTF-8"):
        read_sources(tmp_path / "other.csv")
    pytest.importorskip("openpyxl", reason="the extra xlsx is not installed")
    (tmp_path / "other.xlsx").write_bytes(b"PK\x03\x04 nothing more")
    with pytest.raises(SourceListError, match="is no workbook"):
        read_sources(tmp_path / "other.xlsx")


def test_a_list_has_so_many_rows_and_bytes_and_no_more(tmp_path, monkeypatch):
    path = listed(tmp_path, *ROWS)
    monkeypatch.setattr(source_list, "_MOST_BYTES", path.stat().st_size)
    monkeypatch.setattr(source_list, "_MOST_ROWS", len(ROWS) + 1)
    assert len(read_sources(path)) == len(ROWS)
    monkeypatch.setattr(source_list, "_MOST_ROWS", len(ROWS))
    with pytest.raises(SourceListError, match=f"more than {len(ROWS)} rows; give fewer sources"):
        read_sources(path)
    monkeypatch.setattr(source_list, "_MOST_BYTES", path.stat().st_size - 1)
    with pytest.raises(SourceListError, match="is larger than 0 MB; give the list alone"):
        read_sources(path)


def test_a_workbook_that_unpacks_to_more_than_memory_has_is_refused(tmp_path):
    pytest.importorskip("openpyxl", reason="the extra xlsx is not installed")
    path = tmp_path / "bomb.xlsx"
    with ZipFile(path, "w", ZIP_DEFLATED) as book:
        book.writestr("xl/sharedStrings.xml", bytes(101_000_000))
    with pytest.raises(SourceListError, match=r"is no workbook .it unpacks to 101 MB"):
        read_sources(path)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("a,constant,1 urad,,fixed,each,1,,1", "row 2, a: y is empty before z; give 0 where nothing gets there"),
        ("a,constant,1 urad,,fixed,each,,1", "row 2, a: x is empty before y"),
        ("a,constant,1 urad,,fixed,each,1,1,,,,,,said,9", 'row 2: "9" stands in a column without a name'),
    ],
)
def test_a_cell_that_is_empty_or_too_much_moves_no_other(tmp_path, row, said):
    with pytest.raises(SourceListError, match=re.escape(said)):
        read_sources(listed(tmp_path, row))


ALL_OF_A_BUDGET = {
    "a drift with what a transient has": (
        lambda: made(BudgetSource, kind="drift", statistic="fixed", gains=(), size_rad=0.0, decay_s=3.0).problems(),
        """
        size does not belong to class = "drift": expected this line removed; rate is missing, and class = "drift"
        needs it: expected rate = "1 nrad/s" would do; period is missing, and class = "drift" needs it: expected
        period = "6 h" would do; decay does not belong to class = "drift": expected this line removed; gains has 0
        items: expected one for each axis: gains = [1.0, 1.0]
        """,
    ),
    "a process of three sigmas about four axes": (
        lambda: made(
            BudgetSource, kind="process", statistic="3-sigma", gains=(1.0, 2.0, 3.0, 4.0), rate_rad_s=0.0
        ).problems(),
        """
        size is missing, and class = "process" needs it: expected size = "1 urad" would do; rate does not belong to
        class = "process": expected this line removed; corner is missing, and class = "process" needs it: expected
        corner = "1 Hz" would do; gains has 4 items: expected one for each axis: gains = [1.0, 1.0]; statistic does
        not belong to a process: expected its rms: statistic = "1-sigma"
        """,
    ),
    "a random error that is fixed": (
        lambda: made(
            BudgetSource, kind="random", statistic="fixed", gains=(0.0,), size_rad=1.0, frequency_hz=2.0
        ).problems(),
        """
        frequency does not belong to class = "random": expected this line removed; statistic does not belong to a
        random error: expected "1-sigma", "2-sigma", "3-sigma" or "bound"
        """,
    ),
    "an error of each observation that is fixed": (
        lambda: made(BudgetSource, kind="per-observation", statistic="fixed", gains=(0.0,), period_s=2.0).problems(),
        """
        size is missing, and class = "per-observation" needs it: expected size = "1 urad" would do; period does not
        belong to class = "per-observation": expected this line removed; statistic leaves no other one in the next
        observation: expected class = "constant", or how it is spread
        """,
    ),
    "a transient and a sinusoid without their keys": (
        lambda: [
            *made(BudgetSource, kind="transient", statistic="bound", gains=(0.0,)).problems(),
            *made(BudgetSource, kind="periodic", statistic="bound", gains=(0.0,)).problems(),
        ],
        """
        size is missing, and class = "transient" needs it: expected size = "1 urad" would do; period is missing, and
        class = "transient" needs it: expected period = "95 min" would do; decay is missing, and class = "transient"
        needs it: expected decay = "10 s" would do; size is missing, and class = "periodic" needs it: expected size
        = "1 urad" would do; frequency is missing, and class = "periodic" needs it: expected frequency = "0.2 mHz"
        would do
        """,
    ),
    "a difference without its times": (
        lambda: made(BudgetRequirement, index="PRE").problems(),
        """
        window is missing, and index = "PRE" needs it: expected window = "10 ms" would do; spacing is missing, and
        index = "PRE" needs it: expected spacing = "1 min" would do; observation is missing, and index = "PRE" needs
        it: expected observation = "95 min" would do
        """,
    ),
    "a knowledge with times": (
        lambda: made(BudgetRequirement, index="AKE", window_s=1.0, observation_s=2.0).problems(),
        """
        window does not belong to index = "AKE": expected this line removed; observation does not belong to index =
        "AKE": expected this line removed
        """,
    ),
    "a budget of nothing": (
        lambda: made(ErrorBudget, with_loop=False, sources={}, requirements={}).problems(),
        """
        sources holds no source: expected a table such as [error_budget.sources.alignment]; requirements holds none:
        expected a table such as [error_budget.requirements.code_word]
        """,
    ),
    "a budget of a loop about three axes": (
        lambda: made(
            ErrorBudget,
            with_loop=True,
            sources={
                "a": SimpleNamespace(gains=(1, 2, 3)),
                "b": SimpleNamespace(gains=(1,)),
                "c": SimpleNamespace(gains=(1, 2)),
            },
            requirements={
                "p": SimpleNamespace(index="APE", axes="z"),
                "q": SimpleNamespace(index="RKE", axes="x"),
                "r": SimpleNamespace(index="MKE", axes="y"),
            },
        ).problems(),
        """
        sources.b.gains has 1 item, and others have 3: expected as many each; sources.c.gains has 2 items, and
        others have 3: expected as many each; requirements.q.index is of what is known, and the loop leaves errors
        of the pointing: expected with_loop = false, and sources of knowledge alone; with_loop has two axes, and the
        sources have 3: expected gains for x and y
        """,
    ),
    "a budget about one axis": (
        lambda: made(
            ErrorBudget,
            with_loop=False,
            sources={"a": SimpleNamespace(gains=(1,))},
            requirements={
                "p": SimpleNamespace(index="AKE", axes="x"),
                "q": SimpleNamespace(index="RKE", axes="radial"),
                "r": SimpleNamespace(index="MKE", axes="y"),
                "s": SimpleNamespace(index="MKE", axes="z"),
            },
        ).problems(),
        """
        requirements.q.axes needs 2 axes, and the sources have 1: expected more gains; requirements.r.axes needs 2
        axes, and the sources have 1: expected more gains; requirements.s.axes needs 3 axes, and the sources have 1:
        expected more gains
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_BUDGET)
def test_all_that_does_not_fit_in_a_budget_is_told_in_full(what):
    problems, words = ALL_OF_A_BUDGET[what]
    assert told(problems()) == one_line(words)


@pytest.mark.parametrize(
    ("rows", "head", "said"),
    [
        (
            ["a,constant,1 urad,,fixed,together,q,1"],
            HEADING,
            ', row 2, x: "q" is no number; give the gain to that axis',
        ),
        (
            ["a,constant,1 urad,,fixed,together,1,1", "b,constant,-1 urad,,fixed,together,1,1"],
            *(HEADING, ", row 3, b: size is below 0 rad; expected an angle with its unit, at least 0 rad, at most "),
        ),
        (
            ["a,process,1 urad,,2-sigma,together,1,1"],
            HEADING,
            ', row 2, a: corner is missing, and class = "process" needs it; expected corner = ',
        ),
        (["a,constant,1 urad,,fixed,both,1,1"], HEADING, ', row 2, a: axes is "both": input should be '),
        (["a,constant,1 urad"], "name,class,size,statistic,axes,x", ", row 2, a: statistic is missing"),
        (
            [f"{'a' * 70},constant,1 urad,,fixed,each,,1"],
            HEADING,
            f", row 2, {'a' * 59}…: x is empty before y; give 0 where nothing gets there",
        ),
        ([",constant,1 urad,,fixed,each,1,1"], HEADING, ", row 2: has no name; give it one"),
        (
            ["a,constant"],
            *(
                HEADING.replace("size", "length"),
                ': no column is called "length"; its first row names columns out of name, class, size, rate, '
                "statistic, axes, corner, frequency, period, decay, x, y, z, origin",
            ),
        ),
        (["a,constant"], HEADING + ",x", ": two columns have one name; rename one of them"),
        ([], HEADING, ": holds no source; give a row for each below the names of the columns"),
    ],
)
def test_what_a_list_of_sources_lacks_is_told_with_row_name_and_remedy(tmp_path, rows, head, said):
    path = listed(tmp_path, *rows, head=head)
    with pytest.raises(SourceListError) as refused:
        read_sources(path)
    assert str(refused.value).startswith(f"{path}{said}")


def test_a_list_that_is_not_there_or_no_text_says_what_to_do(tmp_path):
    (tmp_path / "other.csv").write_bytes(b"\xff\xfe\x00name")
    for name, said in (
        ("none.csv", "cannot be read (No such file or directory); check the path"),
        ("other.csv", "is no text in UTF-8; save it as CSV in UTF-8, or as .xlsx"),
    ):
        with pytest.raises(SourceListError) as refused:
            read_sources(tmp_path / name)
        assert str(refused.value) == f"{tmp_path / name}: {said}"


def test_three_axes_a_rate_and_an_origin_of_a_list_are_those_of_its_row(tmp_path):
    head = "Origin;NAME;class;rate;;period;statistic;axes;z;x;y"
    path = listed(tmp_path, "of ours;slow;drift;2.5 nrad/s;;1.5 h;fixed;each;-0.25;0.5;0.0", head=head)
    (found,) = read_sources(path)
    assert (found.name, found.origin, found.source.kind, found.source.axes) == ("slow", "of ours", "drift", "each")
    assert (found.source.gains, found.source.statistic, found.source.size_rad) == ((0.5, 0.0, -0.25), "fixed", None)
    assert (found.source.rate_rad_s, found.source.period_s) == pytest.approx((2.5e-9, 5400.0))


def test_a_workbook_may_end_in_capitals_and_is_read_from_its_first_sheet_whichever_was_open(tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="the extra xlsx is not installed")
    book = openpyxl.Workbook()
    for row in (HEADING, ",", ROWS[1], "", ROWS[3]):
        book.active.append([cell or None for cell in row.split(",")])
    book.active = book.create_sheet("notes")
    book.active.append(["nothing of a list"])
    book.create_sheet("more")
    book.save(tmp_path / "ERRORS.XLSX")
    found = read_sources(tmp_path / "ERRORS.XLSX")
    assert [each.name for each in found] == ["star tracker", "wheels"]
    assert [each.source for each in found] == [each.source for each in read_sources(listed(tmp_path, ROWS[1], ROWS[3]))]
    assert found[0].origin == f"{tmp_path / 'ERRORS.XLSX'}, row 3"  # the empty row counts


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_blanks_about_cells_and_lines_of_another_platform_change_nothing(tmp_path, end):
    path = tmp_path / "errors.txt"
    rows = (HEADING.title(), "", *ROWS)
    path.write_bytes(end.join(" , ".join(f"\t{row} ".split(",")) for row in rows).encode())
    found, plain = read_sources(path), read_sources(listed(tmp_path, *ROWS))
    assert [(each.name, each.source) for each in found] == [(each.name, each.source) for each in plain]
    assert [found[0].origin, found[1].origin] == ["ground calibration", f"{path}, row 4"]


def budget(sources, **more):
    """A table of a budget with sources of so many axes each, by name."""
    required = {"one": {"index": "APE", "confidence": 0.9, "interpretation": "mixed", "axes": "x", "limit": "9 urad"}}
    given = {
        name: {"class": "constant", "size": size, "statistic": "fixed", "axes": "each", "gains": gains}
        for name, (size, gains) in sources.items()
    }
    return ErrorBudget.model_validate({"with_loop": False, "sources": given, "requirements": required} | more)


@pytest.mark.parametrize("order", [(1, 2), (2, 1), (3, 2), (2, 3)])
def test_a_source_of_more_axes_or_fewer_than_the_first_is_told(order):
    first, second = ([1.0] * count for count in order)
    with pytest.raises(ValueError, match=r"gains has .* item.*, and others have") as refused:
        budget({"a": ("1 urad", first), "b": ("1 urad", second), "c": ("2 urad", first)})
    told_once = str(refused.value)
    assert f"sources.b.gains has {order[1]} item{'s' * (order[1] > 1)}, and others have {order[0]}" in told_once
    assert "sources.a" not in told_once and "sources.c" not in told_once
    assert budget({"a": ("1 urad", first), "b": ("2 urad", first)}).axes == order[0]


def test_budgets_are_one_where_all_their_numbers_are():
    sources = {"a": ("1 urad", [1.0, 0.5]), "b": ("2 urad", [1.0, 0.0])}
    own = budget(sources)
    assert (own, hash(own)) == (budget(sources), hash(budget(sources)))
    others = [
        budget(sources | {"b": ("3 urad", [1.0, 0.0])}),
        budget(sources | {"a": ("1 urad", [1.0, 0.25])}),
        budget(sources, with_loop=True),
        budget(
            sources,
            requirements={
                "one": {"index": "APE", "confidence": 0.9, "interpretation": "mixed", "axes": "y", "limit": "9 urad"}
            },
        ),
    ]
    assert own not in others and len({hash(own), *map(hash, others)}) == 5


@pytest.mark.parametrize(("length", "shown"), [(59, 59), (60, 60), (61, 59), (400, 59)])
def test_a_cell_of_sixty_letters_is_told_whole_and_a_longer_one_by_its_begin(tmp_path, length, shown):
    name = "".join(chr(ord("a") + place % 26) for place in range(length))
    path = listed(tmp_path, f"{name},constant,1 urad,,3-sigma,each,,1")
    with pytest.raises(SourceListError) as refused:
        read_sources(path)
    told_name = name[:shown] + "…" * (length > 60)
    assert str(refused.value) == (f"{path}, row 2, {told_name}: x is empty before y; give 0 where nothing gets there")


@pytest.mark.parametrize(
    ("row", "head", "said"),
    [
        ("a,constant,1 urad,,fixed,each,,,1", HEADING, ", row 2, a: x is empty before z; give 0 where nothing gets"),
        ("a", "name,length,class,gain,x", ': no column is called "length"; its first row'),
        ("a", "name,size,x,class", ': it has no column "statistic"; its first row'),
        ("a", "name,size,extent", ': no column is called "extent"; its first row'),
        ("a,constant,1 urad,7,8", "name,class,,,size,statistic,axes,x", ', row 2: "1 urad" stands in a column without'),
    ],
)
def test_of_several_cells_and_columns_that_do_not_fit_the_first_is_told(tmp_path, row, head, said):
    path = listed(tmp_path, row, head=head)
    with pytest.raises(SourceListError) as refused:
        read_sources(path)
    assert str(refused.value).startswith(f"{path}{said}")


def test_the_first_row_alone_says_what_separates_cells_and_blanks_need_no_name(tmp_path):
    row = 'a,constant,1 urad,,fixed,each,1,0.5,,"one; two; three; four; five; six; seven; eight; nine; ten; eleven"'
    head = "name,class,size,rate,statistic,axes,x,y,z,origin,,"
    (found,) = read_sources(listed(tmp_path, f"{row},  ,", head=head))
    assert (found.name, found.source.gains) == ("a", (1.0, 0.5))
    assert found.origin == "one; two; three; four; five; six; seven; eight; nine; ten; eleven"


def test_what_the_parts_of_a_workbook_unpack_to_counts_together(tmp_path, monkeypatch):
    pytest.importorskip("openpyxl", reason="the extra xlsx is not installed")
    monkeypatch.setattr(source_list, "_MOST_UNPACKED_BYTES", 3_000_000)
    path = tmp_path / "parts.xlsx"
    with ZipFile(path, "w", ZIP_DEFLATED) as book:
        for name, size in (("a", 1_000_000), ("b", 1_500_000), ("c", 2_500_000)):
            book.writestr(f"xl/{name}.xml", bytes(size))
    with pytest.raises(SourceListError, match=r"is no workbook .it unpacks to 5 MB"):
        read_sources(path)
