"""The figures of a campaign in the studio, from a ledger that grows while it is read; no row is simulated here."""

import json
import math
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from microrad.campaign import bundle, run
from microrad.campaign.file import load_campaign
from microrad.campaign.ledger import Ledger, chunk_format
from microrad.campaign.records import CampaignError, Chunk, Failed
from microrad.campaign.rows import sampling
from microrad.campaign.rows.plan import planned
from microrad.campaign.statistics import interim
from microrad.campaign.statistics.interim import Interim
from microrad.campaign.statistics.summary import summarise_campaign
from microrad.loop.pointing_loop.ensemble import bin_edges_rad
from microrad.report.campaign import words as campaign_words
from microrad.report.tables import Table
from microrad.report.view import View
from microrad.studio.jobs import ledgers as campaign_live
from microrad.studio.jobs.ledgers import Live, LiveCampaigns
from microrad.studio.views import campaign as campaign_view
from small_campaign import campaign_file
from waiting import HANG_S

LIMIT = '\n[limits]\nresidual_rms = { most = "5 urad" }\n'
GRID = '\n[grid]\n"communication.data_rate" = ["1 Gbit/s", "2 Gbit/s"]\n'


ROWS = 512


class Growing:
    """A ledger that gets its chunks one by one: of the rows that a campaign draws, with outputs made up here."""

    def __init__(self, folder, more="", runs=ROWS, failed=()):
        self.path, self.failed = folder / "x.ledger", failed
        self.campaign = load_campaign(campaign_file(folder, runs=runs, duration="16 s", more=LIMIT + more))
        self.head = run._head(self.campaign, bundle.packed(self.campaign, ()))
        self.rows = planned(self.campaign).chunk_rows
        self.every = len(planned(self.campaign).chunks(0, runs))
        self.begin()

    def begin(self, seed=1):
        self.random = np.random.default_rng(seed)
        with Ledger.create(self.path, replace(self.head, created=str(seed))) as book:
            book.note("state", "running")
            book.note("seconds", 10.0)

    def put(self, *numbers, cell=0):
        with Ledger.open(self.path, write=True) as book:
            for number in numbers:
                book.put(cell, number, chunk_format.pack_chunk(self.chunk(number, cell)))

    def chunk(self, number, cell=0):
        rows = planned(self.campaign).rows_of(number)
        drawn, weight = sampling.rows(self.campaign, cell, rows.start, len(rows))
        columns = {"row": np.arange(rows.start, rows.stop, dtype=float), "weight": weight, **drawn}
        lost = np.isin(columns["row"], self.failed)
        for output in self.campaign.outputs:
            values = self.random.lognormal(math.log(4e-6), 0.2, len(rows))
            columns[output.name] = np.where(lost, math.nan, values)
        failed = tuple(Failed(row, 7, 2, "the reason") for row in rows if row in self.failed)
        beyond = np.exp(-0.5 * (bin_edges_rad()[:-1] / 3e-6) ** 2)
        return Chunk(cell, number, columns, failed, len(rows) * beyond, len(rows) * beyond**2)

    def end(self):
        with Ledger.open(self.path, write=True) as book:
            book.note("state", "complete")


@pytest.fixture
def growing(tmp_path):
    return Growing(tmp_path)


@pytest.fixture
def at_once(monkeypatch):
    """A look reads at any time, however short the last one is ago, and to the end, however slow the machine is."""
    monkeypatch.setattr(campaign_live, "_READ_S", HANG_S)
    monkeypatch.setattr(campaign_live, "_PAUSE_S", 0.0)
    monkeypatch.setattr(campaign_live, "_REST", 0.0)


def same(found, wanted, outputs=True):
    """The statistics of two summaries agree; the sums were made in another order."""
    for a, b in zip(found.cells, wanted.cells, strict=True):
        assert (a.rows, a.failed, a.values) == (b.rows, b.failed, b.values)
        assert tuple(vars_of(a.missed)) == pytest.approx(tuple(vars_of(b.missed)))
        assert a.missed_by.keys() == b.missed_by.keys()
        if outputs and a.outputs:
            for name, output in a.outputs.items():
                for p, quantile in output.quantiles.items():
                    wants = b.outputs[name].quantiles[p]
                    assert vars_of(quantile) == pytest.approx(vars_of(wants), nan_ok=True)


def vars_of(interval):
    return interval.value, interval.low, interval.high, interval.confidence


# ---------------------------------------------------------------------------------------------------------- the reader
@pytest.mark.promise("studio-13")
def test_a_growing_ledger_says_at_each_time_what_its_rows_say(growing):
    """Chunks come out of order, some rows have failed, and the campaign's own summary is the measure."""
    reader = Interim(growing.path)
    growing.failed = (3, 70)
    growing.put(1)
    first = reader.look()
    same(first, summarise_campaign(growing.path))
    assert first.progress.rows_done == growing.rows
    assert reader.look() is first  # nothing is new
    growing.put(3, 0)
    second = reader.look()
    assert second is not first
    same(second, summarise_campaign(growing.path))
    assert second.cells[0].rows == 3 * growing.rows
    assert 0.0 < second.cells[0].missed.low < second.cells[0].missed.value < second.cells[0].missed.high < 1.0
    growing.put(*(n for n in range(growing.every) if n not in (0, 1, 3)))
    growing.end()
    whole = reader.look()
    same(whole, summarise_campaign(growing.path))
    assert (whole.progress.state, whole.progress.rows_done, whole.cells[0].failed) == ("complete", ROWS, 2)
    assert campaign_words.headline(whole) == campaign_words.headline(summarise_campaign(growing.path))


@pytest.mark.promise("studio-27")
def test_each_chunk_is_read_once(growing, monkeypatch):
    taken = []
    take = interim.CellRows.take
    monkeypatch.setattr(interim.CellRows, "take", lambda cell, chunk: (taken.append(chunk.number), take(cell, chunk)))
    reader = Interim(growing.path)
    for number in (0, 2, 1):
        growing.put(number)
        reader.look()
        reader.look()
    assert taken == [0, 2, 1]


def test_a_long_ledger_is_read_a_little_at_a_time(growing):
    growing.put(*range(growing.every))
    reader = Interim(growing.path)
    seen = []
    while not seen or seen[-1] < ROWS:
        found = reader.look(0.0)
        seen.append(found.cells[0].rows)
        assert found.progress.rows_done == ROWS
    assert seen == [growing.rows * (k + 1) for k in range(growing.every)]
    same(found, summarise_campaign(growing.path))


def test_a_reader_in_the_middle_of_a_writers_transaction_sees_whole_chunks(growing):
    growing.put(0)
    reader = Interim(growing.path)
    with Ledger.open(growing.path, write=True) as book, book._writing("write"):
        row = (0, 1, b"half a checksum", b"half a chunk")
        book._connection.execute("INSERT INTO chunks VALUES (?, ?, ?, ?)", row)
        assert reader.look().cells[0].rows == growing.rows
        book._connection.execute("DELETE FROM chunks WHERE number = 1")
    growing.put(1)
    assert reader.look().cells[0].rows == 2 * growing.rows


def test_another_campaign_in_the_same_place_and_chunks_taken_out_are_read_anew(growing):
    growing.put(0, 1, 2)
    reader = Interim(growing.path)
    assert reader.look().cells[0].rows == 3 * growing.rows
    with Ledger.open(growing.path, write=True) as book:
        book._connection.execute("DELETE FROM chunks WHERE number = 2")
    same(reader.look(), summarise_campaign(growing.path))
    assert reader.found.cells[0].rows == 2 * growing.rows
    for path in growing.path.parent.glob("x.ledger*"):
        path.unlink()
    growing.begin(seed=2)
    assert reader.look().cells[0].rows == 0, "nothing is left of the one before"
    growing.put(0, 1, 2)
    same(reader.look(), summarise_campaign(growing.path))
    assert reader.found.cells[0].rows == 3 * growing.rows


def test_of_a_grid_the_cell_that_is_shown_alone_has_outputs(tmp_path):
    growing = Growing(tmp_path, GRID, runs=64)
    growing.put(0)
    growing.put(0, cell=1)
    found, wanted = Interim(growing.path).look(), summarise_campaign(growing.path)
    same(found, wanted)
    shown = [bool(cell.outputs) for cell in found.cells]
    assert sorted(shown) == [False, True]
    assert campaign_words.best(found).values == campaign_words.best(wanted).values
    assert campaign_words.best(found).outputs


def test_a_ledger_cannot_write_outside_of_its_own_folder(growing, tmp_path):
    for name in ("../planted.txt", str(tmp_path / "planted.txt"), "a/../../planted.txt", ".."):
        data = json.loads(growing.head.bundle)
        data["files"][name] = ""
        with pytest.raises(CampaignError, match="which microrad never puts there: leave it alone"):
            bundle.opened(json.dumps(data).encode())
    assert not (tmp_path / "planted.txt").exists()
    data["files"].pop(name)
    data["files"]["a/../kept.txt"] = ""
    assert bundle.opened(json.dumps(data).encode()).campaign.rows == ROWS


# ------------------------------------------------------------------------------------------------------- for all tabs
def test_every_tab_is_told_the_same(growing, at_once):
    tabs = LiveCampaigns()
    growing.put(0)
    first = tabs.look(growing.path)
    assert (first.rows, first.failed, first.fault) == (growing.rows, 0, "")
    assert tabs.look(growing.path) is first
    growing.put(1)
    found = []
    threads = [threading.Thread(target=lambda: found.append(tabs.look(growing.path))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {each.rows for each in found} <= {growing.rows, 2 * growing.rows}
    assert tabs.look(growing.path).rows == 2 * growing.rows


def test_between_two_readings_there_is_a_pause(growing, monkeypatch):
    monkeypatch.setattr(campaign_live, "_PAUSE_S", 3600.0)
    tabs = LiveCampaigns()
    growing.put(0)
    first = tabs.look(growing.path)
    growing.put(1)
    assert tabs.look(growing.path) is first


def test_a_ledger_that_is_not_there_yet_says_nothing(tmp_path, at_once):
    tabs = LiveCampaigns()
    path = tmp_path / "x.ledger"
    assert tabs.look(path) == Live()
    assert campaign_view.figures(Live()) is None
    growing = Growing(tmp_path)
    assert tabs.look(path).rows == 0
    assert campaign_view.figures(tabs.look(path)) is None
    growing.put(0)
    assert tabs.look(path).rows == growing.rows
    for each in tmp_path.glob("x.ledger*"):
        each.unlink()
    assert tabs.look(path) == Live()


@pytest.mark.promise("studio-27")
def test_damage_and_other_files_are_told_and_what_was_read_stays(growing, at_once):
    tabs = LiveCampaigns()
    growing.put(0)
    rows = tabs.look(growing.path).rows
    with Ledger.open(growing.path, write=True) as book, book._writing("write"):
        book._connection.execute("INSERT INTO chunks VALUES (0, 1, x'00', x'00')")
    found = tabs.look(growing.path)
    assert (found.rows, rows) == (growing.rows, growing.rows)
    assert "chunk 1 of cell 0 is damaged, its checksum differs; `microrad campaign resume" in found.fault
    with Ledger.open(growing.path, write=True) as book:
        book._connection.execute("DELETE FROM chunks WHERE number = 1")
    assert tabs.look(growing.path).fault == ""
    other = growing.path.with_name("other.ledger")
    other.write_text("a text", "utf-8")
    assert "is no ledger, or its first page" in tabs.look(other).fault


@pytest.mark.parametrize("made_up", [b'{"code": ""}', b'{"code": "", "files": []}', b"[]", b"[" * 100_000])
def test_a_made_up_ledger_is_told(tmp_path, growing, at_once, made_up):
    path = tmp_path / "made-up.ledger"
    with Ledger.create(path, replace(growing.head, bundle=made_up)):
        pass
    assert "a campaign as microrad never writes it: leave it alone" in LiveCampaigns().look(path).fault


def test_whatever_else_a_ledger_may_hold_is_told(growing, monkeypatch):
    def look(self, most_s):
        raise TypeError("odd")

    monkeypatch.setattr(Interim, "look", look)
    told = f"{growing.path.name} is no ledger that microrad wrote: its contents cannot be read (TypeError: odd)"
    assert LiveCampaigns().look(growing.path).fault == told


def told(*cells, done, total=100, state="running"):
    """A summary as far as its rows go: (rows, failed) of each cell."""
    rows = [SimpleNamespace(rows=n, failed=lost) for n, lost in cells]
    return SimpleNamespace(cells=rows, progress=SimpleNamespace(rows_done=done, rows_total=total, state=state))


def test_rows_are_counted_over_all_cells_and_those_not_read_yet_are_behind():
    nothing = Live()
    assert (nothing.rows, nothing.failed, nothing.behind) == (0, 0, False)
    for done, behind in ((5, False), (6, True)):
        live = Live(told((2, 1), (3, 1), done=done))
        assert (live.rows, live.failed, live.behind) == (5, 2, behind)


class Read:
    """In place of the reader of a ledger: what it finds at each look."""

    def __init__(self, *found):
        self.found, self.paths = list(found), []

    def __call__(self, path):
        self.paths.append(path)
        return self

    def look(self, most_s):
        found = self.found.pop(0)
        if isinstance(found, Exception):
            raise found
        return found


def test_a_reader_that_is_behind_reads_on_at_once_and_otherwise_rests(tmp_path, monkeypatch):
    now, part, whole = [100.0], told((1, 0), done=9), told((9, 0), done=9)
    reader = Read(part, whole, whole)
    monkeypatch.setattr(interim, "Interim", reader)
    monkeypatch.setattr(campaign_live, "time", SimpleNamespace(monotonic=lambda: now[0]))
    path, tabs = tmp_path / "x.ledger", LiveCampaigns()
    path.touch()
    assert [tabs.look(path).rows for _ in range(3)] == [1, 9, 9]
    assert len(reader.found) == 1
    now[0] += campaign_live._PAUSE_S - 0.01
    tabs.look(path)
    assert len(reader.found) == 1
    now[0] += 0.01
    tabs.look(path)
    assert (reader.found, reader.paths) == ([], [path])  # opened once


def test_a_fault_keeps_what_was_read_and_is_named_where_it_has_no_words(tmp_path, at_once, monkeypatch):
    rows = told((1, 0), done=1)
    monkeypatch.setattr(interim, "Interim", Read(rows, OSError(), ValueError("the words"), rows, rows))
    path, tabs = tmp_path / "x.ledger", LiveCampaigns()
    path.touch()
    found = [tabs.look(path) for _ in range(5)]
    assert [(each.rows, each.fault) for each in found] == [(1, ""), (1, "OSError"), (1, "the words"), (1, ""), (1, "")]
    assert found[4] is found[3]


def test_the_ledgers_looked_at_last_are_kept_in_mind(tmp_path, monkeypatch):
    monkeypatch.setattr(campaign_live, "_MOST", 2)
    tabs = LiveCampaigns()
    for name in "abacb":
        tabs.look(tmp_path / name)
        if name == "c":
            assert [path.name for path in tabs._readers] == ["a", "c"]
    assert [path.name for path in tabs._readers] == ["c", "b"]


# -------------------------------------------------------------------------------------------------------- on the page
@pytest.mark.parametrize(
    ("rows", "done", "total", "state", "words"),
    [
        (1, 1, 1, "complete", "Of the only row"),
        (2, 2, 2, "complete", "Of all 2 rows"),
        (1, 2, 2, "complete", "Of 1 row so far (2 are wanted); the others in the ledger are being read"),
        (1, 1, 1, "running", "Of 1 row so far"),
        (3, 3, 4, "stopped", "Of 3 rows so far (4 are wanted)"),
        (3, 4, 3, "running", "Of 3 rows so far; the others in the ledger are being read"),
    ],
)
def test_of_how_many_rows_the_figures_are(rows, done, total, state, words):
    summary = told((rows, 0), done=done, total=total, state=state)
    assert campaign_view._rows(Live(summary), summary) == words


# -------------------------------------------------------------------------------------------------------- on the page
def test_the_figures_say_of_how_many_rows_they_are(growing, at_once):
    tabs = LiveCampaigns()
    growing.failed = (3,)
    growing.put(0)
    found = campaign_view.figures(tabs.look(growing.path))
    assert found.rows == f"Of {growing.rows} rows so far ({ROWS} are wanted)"
    assert found.headline.startswith(f"So far: 1 of {growing.rows} rows failed; ")
    views = {view.title: view for view in found.blocks if isinstance(view, View)}
    assert {"Limits", "Outputs", "Tail", "Rows without results"} <= views.keys()
    assert "Over the grid" not in views
    assert (views["How the rows were made"].folded, views["Limits"].folded) == (True, False)
    cell = summarise_campaign(growing.path).cells[0]
    (limit,) = views["Limits"].blocks[0].rows
    assert limit[:2] == ("residual_rms ≤ 5 µrad", f"{100.0 * cell.missed_by['residual_rms'].value:.3g} %")
    low, high = (100.0 * end for end in (cell.missed.low, cell.missed.high))
    said = [float(end.removesuffix(" %")) for end in limit[2].split(" to ")]
    assert said == [pytest.approx(low, abs=0.05), pytest.approx(high, abs=0.05)]
    table = next(each for each in views["Outputs"].blocks if isinstance(each, Table))
    outputs, headings = {row[0]: row for row in table.rows}, table.headings
    assert headings[:3] == ("output", "mean", "deviation")
    median = cell.outputs["residual_rms"].quantiles[0.5]
    shown = outputs["residual_rms"][headings.index("50 %")]
    assert shown.startswith(f"{1e6 * median.value:.2f} µrad\n{1e6 * median.low:.2f}")
    assert views["Rows without results"].blocks[0].rows == [("3", "7", "2", "the reason")]
    growing.put(*range(1, growing.every))
    growing.end()
    whole = campaign_view.figures(tabs.look(growing.path))
    assert whole.rows == f"Of all {ROWS} rows"
    assert whole.headline == campaign_words.headline(summarise_campaign(growing.path))


def test_of_a_grid_that_has_begun_the_combinations_are_told(tmp_path, at_once):
    growing = Growing(tmp_path, GRID, runs=64)
    growing.put(0)
    found = campaign_view.figures(LiveCampaigns().look(growing.path))
    growing.put(0, cell=1)
    both = campaign_view.figures(LiveCampaigns().look(growing.path))
    for each in (found, both):
        assert "Over the grid" in [view.title for view in each.blocks if isinstance(view, View)]
        assert next(iter(each.plots)) == "Distribution of residual_rms"


@pytest.mark.promise("studio-13")
def test_the_plot_shows_the_report_s_distribution_and_what_has_a_limit_first(growing, at_once):
    growing.put(0, 1, 2)
    found = campaign_view.figures(LiveCampaigns().look(growing.path))
    assert next(iter(found.plots)) == "Distribution of residual_rms"
    plot = found.plots["Distribution of residual_rms"]
    assert plot["layout"]["xaxis"]["title"]["text"] == "residual_rms (µrad)"
    assert plot["layout"]["yaxis"]["title"]["text"] == "rows (%)"
    assert "limit ≤ 5 µrad" in [each["name"] for each in (*plot["data"], *plot["layout"]["shapes"]) if each.get("name")]
    unlimited = found.plots[[*found.plots][1]]
    names = [each.get("name") or "" for each in (*unlimited["data"], *unlimited["layout"]["shapes"])]
    assert not any(name.startswith("limit") for name in names)


# ------------------------------------------------------------------------------------ edges of the reader and the page
@pytest.mark.parametrize(("took_s", "rests_s"), [(0.25, 2.0), (0.5, 2.5), (3.0, 15.0)])
def test_a_reading_that_takes_long_is_followed_by_a_longer_rest(tmp_path, monkeypatch, took_s, rests_s):
    now, whole = [100.0], told((9, 0), done=9)

    class Slow(Read):
        def look(self, most_s):
            now[0] += took_s
            assert most_s == campaign_live._READ_S
            return super().look(most_s)

    reader = Slow(whole, whole)
    monkeypatch.setattr(interim, "Interim", reader)
    monkeypatch.setattr(campaign_live, "time", SimpleNamespace(monotonic=lambda: now[0]))
    path, tabs = tmp_path / "x.ledger", LiveCampaigns()
    path.touch()
    tabs.look(path)
    now[0] += rests_s - 0.01
    assert tabs.look(path).rows == 9 and len(reader.found) == 1
    now[0] += 0.01
    assert tabs.look(path).rows == 9 and reader.found == []


def test_a_ledger_that_is_removed_and_made_again_is_opened_again(tmp_path, at_once, monkeypatch):
    first, second = told((4, 1), done=4), told((2, 0), done=2)
    reader = Read(first, second)
    monkeypatch.setattr(interim, "Interim", reader)
    path, other, tabs = tmp_path / "x.ledger", tmp_path / "y.ledger", LiveCampaigns()
    path.touch()
    assert (tabs.look(path).failed, tabs.look(other)) == (1, Live())
    path.unlink()
    assert tabs.look(path) == Live()
    path.touch()
    assert (tabs.look(path).rows, reader.paths) == (2, [path, path])


def test_a_made_up_ledger_is_told_with_what_was_read_of_it(tmp_path, at_once, monkeypatch):
    rows = told((3, 0), done=3)
    monkeypatch.setattr(interim, "Interim", Read(rows, KeyError("cell"), rows))
    path, tabs = tmp_path / "µ x.ledger", LiveCampaigns()
    path.touch()
    found = [tabs.look(path) for _ in range(3)]
    words = "µ x.ledger is no ledger that microrad wrote: its contents cannot be read (KeyError: 'cell')"
    assert [(each.summary, each.fault) for each in found] == [(rows, ""), (rows, words), (rows, "")]


def test_while_one_tab_reads_another_one_is_told_what_was_read_last(tmp_path, at_once):
    tabs, path = LiveCampaigns(), tmp_path / "x.ledger"
    tabs.look(path)
    reader = tabs._readers[path]
    reader.last, reader.interim = Live(told((2, 0), done=5)), None
    path.touch()
    with reader.busy:
        assert tabs.look(path) is reader.last
    assert not reader.busy.locked()


@pytest.mark.parametrize("warnings", [(), ("odd", "rare")])
def test_the_figures_of_a_campaign_stand_in_the_order_of_its_page(monkeypatch, warnings):
    def drawn(name):
        return SimpleNamespace(name=f"campaign-{name}", title=f"Of {name}", sheet=f"sheet {name}")

    summary = told((3, 0), (4, 2), done=7, total=7, state="complete")
    summary.limits = [SimpleNamespace(output=name) for name in ("c", "nowhere", "b")]
    summary.findings, summary.warnings = ("found one", "found two"), warnings
    parts = {"Outputs": [drawn("a"), drawn("b")], "Tail": [drawn("c"), drawn("bb")], "Empty": []}
    titles = ("Limits", "What matters", "How the rows were made", "Outputs")
    asked = []
    monkeypatch.setattr(campaign_view, "campaign_figures", lambda found: parts)
    monkeypatch.setattr(
        campaign_view, "campaign_views", lambda found, figures: asked.append(figures) or [View(t, ()) for t in titles]
    )
    monkeypatch.setattr(campaign_view, "figure", lambda sheet: {"of": sheet})
    monkeypatch.setattr(campaign_view.words, "headline", lambda found: "the headline")
    monkeypatch.setattr(campaign_view.words, "best", lambda found: "the best")
    monkeypatch.setattr(campaign_view.words, "answers", lambda found, best: (f"answer of {best}",))
    found = campaign_view.figures(Live(summary))
    assert (found.rows, found.headline) == ("Of all 7 rows", "the headline")
    assert [*found.plots.items()] == [(f"Of {n}", {"of": f"sheet {n}"}) for n in ("b", "c", "a", "bb")]
    assert asked == [dict.fromkeys(parts, ())]
    said, *more = found.blocks
    assert list(said.lines) == ["found one", "found two", "answer of the best"]
    views = more[2:] if warnings else more
    assert not warnings or (more[0], tuple(more[1].lines)) == ("Warnings:", warnings)
    assert [(view.title, view.folded) for view in views] == [(t, t in titles[1:3]) for t in titles]
