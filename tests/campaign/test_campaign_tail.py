"""Tails of the radial error: how often their intervals hold the truth, of toy processes, weighted draws and a loop."""

import math
import os
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import i0e

import budgets
from microrad import link
from microrad.campaign import run
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.file import load_campaign
from microrad.campaign.ledger import Ledger
from microrad.campaign.records import Chunk, Interval
from microrad.campaign.rows import evaluate, importance_sampling, loops
from microrad.campaign.rows.evaluator import Evaluator
from microrad.campaign.statistics import tails
from microrad.campaign.statistics.intervals import proportion_interval
from microrad.campaign.statistics.summary import summarise_campaign
from microrad.campaign.statistics.tails import tail_of_time, tail_weighted
from microrad.core.arrays import Floats
from microrad.core.threads import in_threads
from microrad.loop.pointing_loop import linear
from microrad.loop.pointing_loop.ensemble import bin_edges_rad, histogram_quantile
from microrad.loop.pointing_loop.kernel_arrays import LANES
from microrad.mission.file import load_mission
from microrad.report.campaign import words as campaign_words
from microrad.report.campaign.data import campaign_data
from microrad.report.campaign.text import campaign_text
from microrad.report.quantities import quantity
from shipped import SHIPPED
from truths import philox

SIGMA = 2e-6
EDGES = bin_edges_rad()


# ------------------------------------------------------------------------------------------------------- toy processes
def counted(seed: int, rows: int, samples: int, memory: float) -> np.ndarray:
    """Histograms (rows, bins) of the radius of two first-order processes."""
    keep = math.exp(-1.0 / memory)
    noise = philox(1000 * 15 + seed).normal(size=(2, rows, samples)) * SIGMA
    noise[:, :, 1:] *= math.sqrt(1.0 - keep**2)
    radius = np.hypot(*lfilter([1.0], [1.0, -keep], noise, axis=-1))
    return np.stack([np.histogram(row, EDGES)[0] for row in radius])


def holds(found: Interval, truth: float) -> bool:
    """An end that is not known leaves all beyond it possible."""
    return not (found.low > truth or found.high < truth)


def shares(counts: np.ndarray) -> Floats:
    return np.asarray(np.cumsum(counts[:, ::-1], axis=1)[:, ::-1] / counts.sum(axis=1, keepdims=True))


@pytest.mark.promise("campaigns-34")
def test_interval_of_a_correlated_tail_holds_rayleighs_quantile() -> None:
    probability = 1e-4
    exact = SIGMA * math.sqrt(-2.0 * math.log(probability))
    held = naive = known = 0
    for seed in range(100):
        share = shares(counted(seed, 64, 5000, 10.0))
        tail = tail_of_time(share.sum(axis=0), (share**2).sum(axis=0), 64, EDGES, [probability], 0.99)
        found = tail.wanted[probability]
        held += holds(found, exact)
        known += found.high < 1.15 * exact
        at = int(np.searchsorted(EDGES, exact))
        band = proportion_interval(share.mean(axis=0)[at] * 320_000, 320_000, 0.99)  # as if all errors were independent
        naive += band.low <= math.exp(-0.5 * (EDGES[at] / SIGMA) ** 2) <= band.high
    assert held >= 95
    assert known >= 95
    assert naive < 93


@pytest.mark.promise("campaigns-28", "campaigns-31")
def test_tail_is_that_of_the_histogram() -> None:
    counts = counted(1, 64, 10_000, 20.0)
    share = shares(counts)
    tail = tail_of_time(share.sum(axis=0), (share**2).sum(axis=0), 64, EDGES, (0.5, 0.01, 1e-3), 0.95)
    for probability, found in tail.wanted.items():
        assert found.value == pytest.approx(histogram_quantile(counts.sum(axis=0), 1.0 - probability), rel=2e-3)
        assert found.low < found.value < found.high
    assert np.all(np.diff(tail.survival) <= 0.0)
    assert np.all((tail.low <= tail.survival) & (tail.survival <= tail.high))
    assert (tail.survival[0], tail.survival[-1], tail.high[-1] > 0.0) == (1.0, 0.0, True)
    assert tail.radius_rad.shape == tail.survival.shape
    assert 640_000 / 20.0 < tail.effective_runs < 640_000  # excursions to 1e-3 are shorter than the memory
    assert "64 rows" in tail.method


def test_between_edges_the_radius_is_rayleighs() -> None:
    exact = np.exp(-0.5 * (EDGES[:-1] / SIGMA) ** 2)
    probabilities = (0.7, 0.1, 3e-3, 1.1e-5)
    tail = tail_of_time(exact * 50, exact**2 * 50, 50, EDGES, probabilities, 0.95)
    for probability in probabilities:
        assert tail.wanted[probability].value == pytest.approx(
            SIGMA * math.sqrt(-2.0 * math.log(probability)), rel=1e-9
        )
        linear = histogram_quantile((-np.diff(exact, append=0.0) * 1e9).astype(int), 1.0 - probability)
        assert linear == pytest.approx(tail.wanted[probability].value, rel=2e-3)


@pytest.mark.promise("campaigns-33")
def test_what_few_rows_cannot_tell_is_not_known() -> None:
    share = shares(counted(2, 4, 1000, 20.0))
    tail = tail_of_time(share.sum(axis=0), (share**2).sum(axis=0), 4, EDGES, (0.3, 1e-6), 0.99)
    assert tail.wanted[0.3].high < 5.0 * SIGMA
    assert math.isnan(tail.wanted[1e-6].high)
    one = tail_of_time(share[0], share[0] ** 2, 1, EDGES, (0.3,), 0.99)
    assert math.isnan(one.wanted[0.3].high)
    assert one.wanted[0.3].value > 0.0
    assert math.isnan(tail_of_time(share[0], share[0] ** 2, 1, EDGES, (), 0.99).effective_runs)
    with pytest.raises(ValueError, match="no rows"):
        tail_of_time(share[0], share[0], 0, EDGES, (0.3,), 0.99)


@pytest.mark.promise("campaigns-32")
def test_far_out_as_many_errors_are_independent_as_where_events_were_many() -> None:
    """Half of the rows have 40 % of their time beyond the first edge, and eight of 64 a little beyond the second.

    The first says that 252 independent errors know as much: 0.2 x 0.8 over the variance of the mean, 0.04 / 63. None
    of so many beyond a radius leaves up to 1 - 0.005^(1 / 252) of the time, however short the few excursions are.
    """
    share = np.array([[1.0, 0.4, 8e-4], *[[1.0, 0.4, 0.0], [1.0, 0.0, 0.0]] * 3, [1.0, 0.0, 0.0]] * 8)
    errors = 0.2 * 0.8 / (0.04 / 63)
    tail = tail_of_time(share.sum(axis=0), (share**2).sum(axis=0), 64, EDGES, (), 0.99)
    assert tail.survival.tolist() == pytest.approx([1.0, 0.2, 1e-4])
    assert tail.high[2] > 1.0 - 0.005 ** (1.0 / errors)


# ------------------------------------------------------------------------------------------------------ weighted draws
def weighted(seed: int, draws: int, shift: float) -> tuple[Floats, Floats]:
    """Radii of two normal numbers that are shifted in any direction, and the logarithm of their weights."""
    random = philox(1000 * 16 + seed)
    angle = random.uniform(0.0, 2.0 * math.pi, draws)
    radius = np.hypot(random.normal(shift * np.cos(angle), 1.0), random.normal(shift * np.sin(angle), 1.0))
    return radius, shift**2 / 2.0 - np.log(i0e(shift * radius)) - shift * radius


@pytest.mark.promise("campaigns-34")
@pytest.mark.parametrize(("draws", "miss"), [(64, 1.0), (256, 0.8), (640, 1.0)])
def test_interval_of_a_weighted_tail_holds_rayleighs_quantile(draws: int, miss: float) -> None:
    probability, held, widths = 1e-6, 0, []
    exact = math.sqrt(-2.0 * math.log(probability))
    for seed in range(200):
        tail = tail_weighted(*weighted(seed, draws, miss * exact), [probability], 0.99)
        found = tail.wanted[probability]
        held += holds(found, exact)
        widths.append(found.high - found.low)
        assert tail.effective_runs > 20 * draws
    assert held >= 194
    assert np.median(widths) < 0.12 * exact  # 9 % of the radius is a factor of 10 in probability


def test_draws_that_are_not_weighted_know_nothing_of_a_rare_tail() -> None:
    tail = tail_weighted(*weighted(1, 640, 0.0), (0.5, 1e-6), 0.99)
    assert tail.wanted[0.5].low < math.sqrt(2.0 * math.log(2.0)) < tail.wanted[0.5].high
    assert math.isnan(tail.wanted[1e-6].high)
    assert tail.effective_runs == pytest.approx(640, rel=0.02)
    many = tail_weighted(*weighted(1, 5000, 5.0), (1e-6,), 0.99)
    assert many.radius_rad.size <= 200
    assert np.all((many.low <= many.survival) & (many.survival <= many.high))
    with pytest.raises(ValueError, match="no draws"):
        tail_weighted(np.empty(0), np.empty(0), (0.5,), 0.99)


def rayleigh(probability: float, sigma: float = 1.0) -> float:
    """Radius that two normal numbers exceed together with a probability."""
    return sigma * math.sqrt(-2.0 * math.log(probability))


def mixed(seed: int, draws: int, aim: float) -> tuple[Floats, Floats]:
    """Radii drawn as weighted runs of a linear loop draw them, aimed at a probability, and the logarithm of weights."""
    level = -math.log(aim)
    by = importance_sampling.Proposal(0, np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), np.ones(2), level - 0.3, level + 1.0)
    found = [importance_sampling.drawn(by, 5000 + seed, LANES * batch) for batch in range(draws // LANES)]
    return np.concatenate([np.hypot(*unit) for unit, _ in found]), np.concatenate([weight for _, weight in found])


@pytest.mark.parametrize("draws", [64, pytest.param(256, marks=pytest.mark.endurance)])
def test_intervals_of_weighted_draws_hold_at_all_radii(draws: int) -> None:
    """Also where the weighted share is near 1, and those of the probability beyond a radius."""
    probabilities = (0.9, 0.5, 0.1, 1e-3, 1e-6)
    radii, repetitions = {p: rayleigh(p) for p in probabilities}, 100
    held, likely = dict.fromkeys(probabilities, 0), dict.fromkeys(probabilities, 0)
    width: dict[float, list[float]] = {p: [] for p in probabilities}
    for seed in range(repetitions):
        tail = tail_weighted(*mixed(seed, draws, 1e-6), probabilities, 0.99, radii.values())
        for p, radius in radii.items():
            found, past = tail.wanted[p], tail.beyond[radius]
            assert 0.0 <= found.low <= found.value <= found.high  # all known
            assert 0.0 <= past.low <= past.value <= past.high <= 1.0
            held[p] += found.low <= radius <= found.high
            likely[p] += past.low <= p <= past.high
            width[p].append(math.log(past.high / max(past.low, 1e-9)))
    assert min(held.values()) >= 96
    assert min(likely.values()) >= 96
    assert np.median(width[1e-6]) < (1.2 if draws == 64 else 0.6)  # a factor in probability, where it is aimed at
    assert np.median(width[0.1]) > 1.0  # and the plain runs, a tenth of all, tell little of the rest


def test_beyond_all_draws_little_is_known_and_below_them_all() -> None:
    radius, log_weight = mixed(1, 256, 1e-6)
    least, most = float(radius.min()), float(radius.max())
    tail = tail_weighted(radius, log_weight, (), 0.99, (0.5 * least, most, 2.0 * most, rayleigh(1e-6)))
    below, last, past, aimed = tail.beyond.values()
    assert (below.value, below.high) == (1.0, 1.0)
    assert 0.8 < below.low < 1.0
    assert last == past  # larger than the largest is none of them
    assert (past.value, past.low) == (0.0, 0.0)
    assert math.exp(-0.5 * most**2) < past.high < 1e-7
    assert past.high < aimed.low < 1e-6 < aimed.high
    flat = tail_weighted(np.arange(1.0, 101.0), np.zeros(100), (0.5,), 0.99, (30.0, 0.0))
    assert flat.beyond[30.0].value == pytest.approx(0.7)
    exact = proportion_interval(70, 100, 0.99)
    assert flat.beyond[30.0].low == pytest.approx(exact.low, abs=0.05)
    assert flat.beyond[30.0].high == pytest.approx(exact.high, abs=0.05)
    assert flat.beyond[0.0].low == pytest.approx(proportion_interval(100, 100, 0.99).low, abs=0.03)


# -------------------------------------------------------------------------------------------------------- the real loop
SEEDS = 100 if os.environ.get("MICRORAD_ENDURANCE") else 20
CAMPAIGN = """
mission = "mission.toml"
seed = 1
runs = 64
sampling = "random"
{keep}

[loop]
controller = "PI"
axes = "both"
mirror = "no hysteresis"
duration = "{duration}"
settle = "0.2 s"

[set]
"fine_pointing.delay" = "1.4 ms"
"fine_pointing.plant_step" = "200 us"
"fine_pointing.optical_sensor.noise" = "0.1 urad"
"fine_pointing.optical_sensor.field_of_view" = "1 rad"
"fine_pointing.strain_gauge.resolution" = "0 urad"
"fine_pointing.drive_resolution" = "1e-9 V"
"fine_pointing.reference.point_ahead_on_mirror" = false
"fine_pointing.reference.rate_feedforward" = 1
"""
"""A loop that is Gaussian, and slow because of its delay: an excursion to 1e-4 lasts for several samples."""


class Slow:
    """Campaigns of this loop, with the controller and the deviation of an axis that they share."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "mission.toml").write_text(SHIPPED.read_text(encoding="utf-8"), encoding="utf-8")
        campaign = self.campaign("1 s")
        own = loops.mission_loop(campaign.mission, campaign.table.loop, campaign.table.seed)
        self.axis = own.tuned()
        covariance = importance_sampling.end_covariance(linear.close(own.row, own.controller(self.axis)), 5000)
        assert covariance == pytest.approx(covariance[0, 0] * np.eye(2), abs=1e-9 * covariance[0, 0])
        self.sigma = math.sqrt(covariance[0, 0])

    def campaign(self, duration: str, more: str = "") -> CampaignFile:
        path = self.folder / "campaign.toml"
        keep = "" if more else 'keep = ["residual_rms"]'
        path.write_text(CAMPAIGN.format(duration=duration, keep=keep) + more, encoding="utf-8")
        return load_campaign(path)

    def chunk(self, campaign: CampaignFile, rows: range, seed: int = 1) -> Chunk:
        """These rows under another seed."""
        seeded = replace(campaign, table=campaign.table.model_copy(update={"seed": seed}))
        found = Evaluator(seeded, {0: self.axis}).rows(0, rows, lambda: None)
        assert not found.failed
        return found


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Slow:
    return Slow(tmp_path_factory.mktemp("slow"))


@pytest.mark.endurance
@pytest.mark.promise("campaigns-28", "campaigns-32")
def test_interval_of_a_loops_tail_holds_rayleighs_quantile(slow: Slow) -> None:
    """64 rows of 4 s each; some 50 excursions are in each repetition."""
    probability, samples = 1e-4, 64 * 20_000
    exact = rayleigh(probability, slow.sigma)
    campaign = slow.campaign("4.2 s")
    chunks = in_threads([partial(slow.chunk, campaign, range(64), seed) for seed in range(SEEDS)], workers=2)
    at = int(np.searchsorted(EDGES, exact))
    truth = math.exp(-0.5 * (EDGES[at] / slow.sigma) ** 2)
    held, naive, shares, events = {0.99: 0, 0.95: 0}, {0.99: 0, 0.95: 0}, [], []
    for chunk in chunks:
        for confidence in held:
            tail = tail_of_time(chunk.survival, chunk.survival_square, 64, EDGES, [probability], confidence)
            found = tail.wanted[probability]
            held[confidence] += found.low <= exact <= found.high < 1.15 * exact
            share = float(chunk.survival[at]) / 64
            band = proportion_interval(share * samples, samples, confidence)  # as if samples were independent
            naive[confidence] += band.low <= truth <= band.high
        shares.append(share)
        events.append(tail.effective_runs * probability)
    assert held[0.99] >= 0.95 * SEEDS
    assert held[0.95] >= 0.88 * SEEDS
    assert naive[0.99] < 0.92 * SEEDS
    assert naive[0.95] < 0.80 * SEEDS
    assert np.mean(shares) == pytest.approx(truth, rel=0.06)
    assert 30 < np.median(events) < 100


@pytest.mark.promise("campaigns-58")
def test_importance_sampling_needs_a_twentieth_of_the_runs(slow: Slow) -> None:
    """Against twenty times as many plain runs of the same length outright, and by what both are worth."""
    probability, runs = 1e-6, 128
    exact = rayleigh(probability, slow.sigma)
    aimed = slow.campaign("0.5 s", f'[tail]\nerror = "{exact * 1e6:.6f} urad"\nprobability = {probability}\n')
    columns = slow.chunk(aimed, range(runs)).columns
    tail = tail_weighted(columns["tail_radius"], columns["tail_log_weight"], (probability,), 0.99, (exact,))
    plain = slow.chunk(slow.campaign("0.5 s"), range(20 * runs))
    time = tail_of_time(plain.survival, plain.survival_square, 20 * runs, EDGES, (probability, 1e-3), 0.99)
    found, other = tail.wanted[probability], time.wanted[probability]
    assert found.low <= exact <= found.high
    assert not other.high - other.low < 2.0 * (found.high - found.low)  # or not known at all
    assert time.wanted[1e-3].low <= rayleigh(1e-3, slow.sigma) <= time.wanted[1e-3].high
    past = tail.beyond[exact]
    assert past.low <= probability <= past.high < 5.0 * past.low
    # what the plain ones tell at 1e-3, with a thousandth of the excursions at 1e-6 and the slope of Rayleigh's tail
    seen = time.wanted[1e-3]
    relative = 0.5 * (seen.high - seen.low) / seen.value / ((found.high - found.low) / found.value)
    assert 20 * runs * 1000 * relative**2 > 2 * 20 * runs


@pytest.mark.promise("campaigns-27")
@pytest.mark.usefixtures("rows_here")
def test_a_campaign_says_how_likely_its_error_is(slow: Slow) -> None:
    """From the command's own ledger: text, data and page."""
    exact = rayleigh(1e-6, slow.sigma)
    tables = f'[tail]\nerror = "{exact * 1e6:.6f} urad"\nprobability = 1e-5\n'
    campaign, book = slow.campaign("0.3 s", tables), slow.folder / "tail.ledger"
    run.run_campaign(campaign.path, book, run.Means(threads=2))
    found = summarise_campaign(book)
    (cell,) = found.cells
    assert cell.tail is not None
    ((error, past),) = cell.tail.beyond.items()
    assert error == pytest.approx(exact, rel=1e-6)
    assert past.low <= 1e-6 <= past.high < 20.0 * past.low
    radius, likely = campaign_words.tail_sentences(found, cell)
    assert radius.startswith("The radial error exceeds ") and "with probability 10⁻⁵ (" in radius
    said = campaign_words.share(past.value)
    assert likely.startswith(f"The radial error is beyond {quantity(error, 'rad')} with probability {said} (")
    assert "at 99 % confidence" in likely and likely in campaign_text(found, 10_000)
    (told,) = campaign_data(found)["cells"][0]["tail"]["beyond"]
    assert told == {"error_rad": error, **asdict(past), "variance": cell.tail.variance[error]}
    assert f"The variance of that estimate is {told['variance']:.2g}, that of " in likely
    with Ledger.open(book, write=False) as opened:
        rows = [chunk.columns for chunk in opened.chunks(0)]
    drawn = {name: np.concatenate([each[name] for each in rows]) for name in ("tail_radius", "tail_log_weight")}
    terms = np.exp(drawn["tail_log_weight"]) * (drawn["tail_radius"] > error)
    assert told["variance"] == pytest.approx(np.var(terms, ddof=1) / terms.size, rel=1e-9)
    assert past.value == pytest.approx(np.mean(terms), rel=1e-12)
    none = replace(cell.tail, beyond={error: replace(past, value=0.0, low=0.0)})
    unseen = campaign_words.tail_sentences(found, replace(cell, tail=none))[1]
    assert unseen.startswith("No radial error beyond ") and "(0 to " in unseen


def test_the_variance_of_a_weighted_share_is_that_of_its_mean() -> None:
    """Of draws of which each counts its weight or nothing: their sample variance over their number."""
    weight, draws = np.array([0.5, 2.0, 1.0]), 5
    counted = np.array([*weight, 0.0, 0.0])
    assert tails._variance(weight, draws) == pytest.approx(np.var(counted, ddof=1) / draws, rel=1e-12)


def test_an_uncorrected_point_ahead_takes_its_part_of_what_the_link_bears(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short is what errs beyond the error that the margin bears, less the point-ahead that stands beside it."""
    m, ahead = load_mission(SHIPPED).mission, 3e-6
    monkeypatch.setattr(link.Shared, "point_ahead_rad", ahead)
    runs = SimpleNamespace(quantile_rad=lambda share: 4e-6, beyond=lambda radius_rad: radius_rad)
    found = evaluate._exposure(link.of(m), runs)  # type: ignore[arg-type]
    fall, on_axis = link.of(m).beam.fall, budgets.communication(m, {}, 0.0).margin_db
    assert found.outage_loss_db == pytest.approx(float(fall.loss_db(7e-6)), rel=1e-12)
    assert found.short_of(0.0) == pytest.approx(fall.error_rad(on_axis) - ahead, rel=1e-9)
    assert found.short_of(3.0) == pytest.approx(fall.error_rad(on_axis - 3.0) - ahead, rel=1e-9)


# ---------------------------------------------------------------------------------------------- where a share is met
@pytest.mark.parametrize(
    ("falling", "probability", "radius"),
    [
        ([1.0, 0.5, 0.25], 1.0, 0.0),  # at the first radius, and not before it
        ([1.0, 0.5, 0.25], 0.5, 1.0),
        ([1.0, 0.5, 0.25], 0.25, 2.0),
        ([1.0, 0.5, 0.25], 0.24, math.nan),
        ([0.5, 0.25, 0.1], 0.51, math.nan),
        ([1.0, 0.25, 0.1], 0.5, math.sqrt(0.5)),  # its logarithm is linear in the square
        ([1.0, 0.5, 0.0], 0.25, math.sqrt(1.0 + 0.5 * 3.0)),  # beside a share of 0 it is itself linear
        ([1.0, 1.0, 0.5], 1.0, 1.0),
        ([0.5, 0.5, 0.5], 0.5, 1.0),
        ([], 0.5, math.nan),
        ([0.3], 0.3, 0.0),
    ],
)
def test_the_radius_of_a_share_is_where_the_falling_share_meets_it(falling, probability, radius) -> None:
    found = tails._crossing(np.arange(float(len(falling))), np.array(falling), probability)
    assert found == pytest.approx(radius, rel=1e-12, nan_ok=True)


@pytest.mark.parametrize(
    ("share", "size", "held"),
    [
        ([0.9, 0.5, 0.1, 0.01], [100.0, 100.0, 300.0, 900.0], [100.0, 100.0, 300.0, 300.0]),
        ([0.9, 0.5, 0.1, 0.01], [400.0, 100.0, 150.0, 900.0], [400.0, 100.0, 100.0, 100.0]),  # too few events at 0.1
        ([0.9, 0.5, 0.1, 0.01], [400.0, 100.0, 150.0, 50.0], [400.0, 100.0, 100.0, 50.0]),  # never made larger
        ([0.99, 0.9, 0.5, 0.1], [900.0, 500.0, 40.0, 10.0], [500.0, 500.0, 40.0, 10.0]),  # few misses at 0.99
        ([0.5, 0.1], [30.0, 9.0], [30.0, 9.0]),  # nowhere enough events
        ([1.0, 0.5, 0.0], [math.nan, 40.0, math.nan], [40.0, 40.0, 40.0]),
    ],
)
def test_the_errors_that_a_share_is_worth_are_held_where_few_events_are_left(share, size, held) -> None:
    np.testing.assert_array_equal(tails._held(np.array(share), np.array(size)), held)


def test_the_rest_of_a_falling_share_is_no_more_and_its_ends_follow() -> None:
    share, low, high = tails._falling(
        np.array([0.9, 0.4, 0.5, 0.1]), np.array([0.8, 0.2, 0.3, -0.1]), np.array([1.2, 0.6, 0.5, 0.7])
    )
    assert share.tolist() == [0.9, 0.4, 0.4, 0.1]
    assert low.tolist() == [0.8, 0.3, 0.3, 0.0]
    assert high.tolist() == [1.0, 0.6, 0.5, 0.5]


@pytest.mark.parametrize(
    ("error", "value", "low", "high"),
    [
        (0.5, 0.9, 0.8, 1.0),  # before all draws
        (1.0, 0.5, 0.4, 0.95),  # a draw at the error is not larger
        (1.5, 0.5, 0.4, 0.95),
        (2.5, 0.1, 0.05, 0.6),
        (3.0, 0.0, 0.0, 0.2),
        (9.0, 0.0, 0.0, 0.2),
    ],
)
def test_what_is_beyond_an_error_counts_the_draws_that_are_larger(error, value, low, high) -> None:
    band = tails._Band(*(np.array(each) for each in ([0.9, 0.5, 0.1], [0.8, 0.4, 0.05], [0.95, 0.6, 0.2], [9.0] * 3)))
    assert tails._beyond(np.array([1.0, 2.0, 3.0]), band, error, 0.99) == Interval(value, low, high, 0.99)


def test_the_worth_of_a_tail_is_that_of_its_smallest_known_probability() -> None:
    band = tails._Band(np.array([1.0, 0.5, 0.1]), np.zeros(3), np.ones(3), np.array([7.0, 8.0, 9.0]))
    known, unknown = Interval(1.0, 0.0, 2.0, 0.99), Interval(math.nan, 0.0, 2.0, 0.99)
    assert tails._effective(band, {0.6: known, 0.2: known}) == 8.0
    assert tails._effective(band, {0.6: known, 0.2: unknown}) == 7.0
    assert tails._effective(band, {1.0: known}) == 7.0
    assert tails._effective(band, {0.05: known}) == 9.0
    assert math.isnan(tails._effective(band, {0.2: unknown})) and math.isnan(tails._effective(band, {}))


ROWS = np.array([[1.0, 0.75, 0.5, 0.25, 0, 0], [1.0, 1.0, 0.625, 0.125, 0.125, 0], [1.0, 0.5, 0.25, 0.25, 0, 0]])
RADII = np.array([0.0, 1.0, 2.0, 4.0, 7.0, 11.0, 16.0])
DRAWS = np.array([5.0, 1.0, 9.0, 2.5, 7.0, 3.0, 12.0])
LOG_WEIGHTS = np.log([0.5, 2.0, 0.125, 1.5, 0.25, 1.0, 0.0625])


def three(found: Interval) -> list[float]:
    return [found.value, found.low, found.high]


def test_the_tail_of_three_rows_has_every_number_of_its_definition() -> None:
    found = tail_of_time(ROWS.sum(axis=0), (ROWS**2).sum(axis=0), 3, RADII, (0.5, 0.2, 1e-3), 0.9)
    assert found.radius_rad.tolist() == [0.0, 1.0, 2.0, 4.0, 7.0, 11.0]
    assert found.survival.tolist() == pytest.approx([1.0, 0.75, 0.4583333, 0.2083333, 0.04166667, 0.0], rel=1e-6)
    assert found.low.tolist() == pytest.approx(
        [0.1707676, 0.1707676, 0.1375754, 0.09701971, 4.813426e-06, 0.0], rel=1e-6
    )
    assert found.high.tolist() == pytest.approx([1.0, 0.9955767, 0.8080073, 0.3658819, 0.3658819, 0.3658819], rel=1e-6)
    wanted = {
        0.5: [1.862782, math.nan, 3.357049],
        0.2: [4.103293, math.nan, math.nan],
        0.001: [10.92117, 5.588594, math.nan],
    }
    for probability, radius in wanted.items():
        assert three(found.wanted[probability]) == pytest.approx(radius, rel=1e-6, nan_ok=True)
        assert found.wanted[probability].confidence == 0.9
    assert found.effective_runs == pytest.approx(23.0, rel=1e-6)
    assert found.method == "share of the time of 3 rows, which are independent"
    assert (found.beyond, found.variance, found.confidence) == ({}, {}, 0.9)


def test_the_tail_of_seven_weighted_draws_has_every_number_of_its_definition() -> None:
    found = tail_weighted(DRAWS, LOG_WEIGHTS, (0.3, 0.02, 1e-6), 0.9, (0.5, 3.0, 8.0, 20.0))
    assert found.radius_rad.tolist() == sorted(DRAWS)
    assert found.survival.tolist() == pytest.approx(
        [1.0, 0.4910714, 0.2767857, 0.1339286, 0.0625, 0.02678571, 0.008928571], rel=1e-6
    )
    assert found.low.tolist() == pytest.approx(
        [0.1627038, 0.1627038, 0.07312718, 0.03209984, 0.01212384, 0.00310045, 0.0001687703], rel=1e-6
    )
    assert found.high.tolist() == pytest.approx(
        [1.0, 1.0, 0.8641637, 0.4302958, 0.2129632, 0.1035197, 0.04723505], rel=1e-6
    )
    wanted = {
        0.3: [2.934911, 0.8142756, 6.107992],
        0.02: [9.886991, 6.054901, math.nan],
        1e-06: [math.nan, math.nan, math.nan],
    }
    for probability, radius in wanted.items():
        assert three(found.wanted[probability]) == pytest.approx(radius, rel=1e-6, nan_ok=True)
    beyond = {
        0.5: [1.0, 0.1627038, 1.0],
        3.0: [0.1339286, 0.03209984, 0.8641637],
        8.0: [0.02678571, 0.00310045, 0.2129632],
        20.0: [0.0, 0.0, 0.04723505],
    }
    for error, share in beyond.items():
        assert three(found.beyond[error]) == pytest.approx(share, rel=1e-6)
    shares = {0.5: 5.4375 / 7.0, 3.0: 0.9375 / 7.0, 8.0: 0.1875 / 7.0, 20.0: 0.0}
    squares = {0.5: 7.58203125, 3.0: 0.33203125, 8.0: 0.01953125, 20.0: 0.0}
    for error, variance in found.variance.items():
        assert variance == pytest.approx((squares[error] / 7.0 - shares[error] ** 2) / 6.0, rel=1e-9, abs=1e-15)
    assert found.effective_runs == pytest.approx(75.46154, rel=1e-6)
    assert found.method == "importance sampling of the noise in 7 runs"


@pytest.mark.parametrize(
    ("sigma", "radius", "level", "slope"),
    [
        ((2.0,), 5.0, 4.388501, 1.411372),
        ((2.0, 0.5), 5.0, 4.351849, 1.412883),
        ((2.0, 2.0), 5.0, 25.0 / 8.0, 5.0 / 4.0),
        ((0.25, 0.125), 0.75, 5.753821, 13.17528),
    ],
)
def test_a_level_has_its_slope_and_leads_back_to_its_radius(sigma, radius, level, slope) -> None:
    found = importance_sampling.level_of(np.array([radius]), np.array(sigma))
    assert [float(each[0]) for each in found] == pytest.approx([level, slope], rel=1e-6)
    back = importance_sampling.radius_of(np.array([level, 0.25 * level]), np.array(sigma))
    assert back[0] == pytest.approx(radius, rel=1e-6) and back[1] < back[0]


def test_levels_are_drawn_with_the_density_of_all_three_shares() -> None:
    by = importance_sampling.Proposal(0, np.zeros((1, 1, 2)), np.zeros((1, 1, 2)), np.array([2.0, 0.5]), 3.0, 7.0)
    density = by.log_density(np.array([0.0, 2.9999, 3.0, 6.9999, 7.0, 9.0]))
    assert density.tolist() == pytest.approx(
        [-2.085668, -3.147261, -0.4416576, -2.521926, -4.502562, -6.502562], rel=1e-6
    )
    unit, log_weight = importance_sampling.drawn(by, 11, 128)
    assert unit.shape == (2, LANES) and log_weight.shape == (LANES,)
    level, _ = importance_sampling.level_of(np.hypot(2.0 * unit[0], 0.5 * unit[1]), by.sigma_rad)
    np.testing.assert_allclose(log_weight, -level - by.log_density(level), rtol=1e-9, atol=1e-9)
    later, weights = importance_sampling.drawn(by, 11, 130)
    np.testing.assert_array_equal(later[:, :-2], unit[:, 2:])
    np.testing.assert_array_equal(weights[:-2], log_weight[2:])
    still = importance_sampling.drawn(replace(by, end=0.0), 11, 128)
    assert not np.any(still[0]) and still[0].shape == (2, LANES) and not np.any(still[1])


def test_levels_cover_two_deviations_about_the_error_less_what_lines_make() -> None:
    pilot = np.array([1.0, -2.0, 3.0, -0.5])
    straight = np.array([1.5, -2.5, 2.0, -1.0])
    begin, end = importance_sampling._levels(pilot, straight, 0.75, 6.0, np.array([2.0, 0.5]))
    square, together = np.mean(pilot**2), np.mean(pilot * straight)
    at, scatter = 6.0 * together / square, math.sqrt(np.mean(straight**2) - together**2 / square)
    ends = importance_sampling.level_of(np.array([at - 2.0 * scatter - 0.75, at + 2.0 * scatter]), np.array([2.0, 0.5]))
    assert (begin, end) == pytest.approx((ends[0][0] - 0.25, ends[0][1] + 1.0), rel=1e-9)
    far = importance_sampling._levels(pilot, straight, 0.75, 600.0, np.array([2.0, 0.5]))
    assert far == pytest.approx((45.75, 47.0))
    assert importance_sampling._levels(pilot, -straight, 0.75, 6.0, np.array([2.0, 0.5]))[0] == 0.0


def test_a_tail_of_one_row_or_run_is_told_in_the_singular():
    one = tail_of_time(np.array([1.0, 0.5, 0.0]), np.array([1.0, 0.25, 0.0]), 1, np.arange(3.0), (0.1,), 0.9)
    assert one.method == "share of the time of 1 row"
    assert tail_weighted(np.ones(1), np.zeros(1), (0.1,), 0.9).method == "importance sampling of the noise in 1 run"


def test_one_row_knows_as_much_as_one_error_and_two_by_how_they_differ() -> None:
    one = np.array([1.0, 0.5, 0.25, 0.0])
    for probability in (0.3, 0.2):
        found = tail_of_time(one, one**2, 1, np.arange(5.0), (probability,), 0.9)
        assert found.effective_runs == pytest.approx(1.0)
    assert found.survival.tolist() == one.tolist()
    # of shares of 1/2 and 1/4: 3/8 times 5/8 over 1/64, the square of half their difference
    both = np.array([[1.0, 0.5, 0.0], [1.0, 0.25, 0.0]])
    two = tail_of_time(both.sum(axis=0), (both**2).sum(axis=0), 2, np.arange(4.0), (0.3,), 0.9)
    assert two.method == "share of the time of 2 rows, which are independent"
    assert two.effective_runs == pytest.approx(15.0)
    with pytest.raises(ValueError, match=r"^a tail of no rows: at least one row has to have succeeded$"):
        tail_of_time(one, one, 0, np.arange(5.0), (0.3,), 0.9)
    with pytest.raises(ValueError, match=r"^a tail of no draws: at least one run has to have succeeded$"):
        tail_weighted(np.zeros(0), np.zeros(0), (0.3,), 0.9)
